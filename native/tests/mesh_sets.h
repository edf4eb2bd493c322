// Meshes to test builders on, ordinary and hard; all from fixed seeds.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "mesh/mesh.h"

namespace perfect_bvh::test {

inline void add_triangle(Mesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.edit().push_back({first, first + 1, first + 2});
}

inline Mesh triangle_soup(std::size_t count, float size, std::uint32_t seed = 1, Vec3f centre = {0, 0, 0},
                          float spread = 1.0f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-spread, spread), offset(-size, size);
  Mesh mesh;
  const auto corner = [&](Vec3f at) { return at + Vec3f{offset(random), offset(random), offset(random)}; };
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at = centre + Vec3f{place(random), place(random), place(random)};
    add_triangle(mesh, corner(at), corner(at), corner(at));
  }
  return mesh;
}

// A bumpy sheet, whose triangles share vertices as in ordinary surfaces.
inline Mesh bumpy_sheet(std::uint32_t side) {
  Mesh mesh;
  for (std::uint32_t y = 0; y <= side; ++y) {
    for (std::uint32_t x = 0; x <= side; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(side);
      const float v = static_cast<float>(y) / static_cast<float>(side);
      mesh.positions.push_back({u, v, 0.1f * std::sin(9.0f * u) * std::cos(7.0f * v)});
    }
  }
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t a = y * (side + 1) + x, b = a + side + 1;
      mesh.triangles.edit().push_back({a, a + 1, b});
      mesh.triangles.edit().push_back({a + 1, b + 1, b});
    }
  }
  return mesh;
}

inline void append(Mesh& mesh, const Mesh& other) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const TriangleIndices& t : other.triangles)
    mesh.triangles.edit().push_back({first + t.x, first + t.y, first + t.z});
}

inline Mesh scaled(Mesh mesh, float factor) {
  for (Vec3f& position : mesh.positions) position = position * factor;
  return mesh;
}

inline Mesh repeated_triangle(std::size_t count) {
  Mesh mesh;
  mesh.positions = {{0.0f, 0.0f, 0.0f}, {1.0f, 0.0f, 0.2f}, {0.0f, 1.0f, 0.4f}};
  mesh.triangles.edit().assign(count, {0, 1, 2});
  return mesh;
}

// Nested triangles around one point.
inline Mesh nested_triangles(std::size_t count) {
  Mesh mesh;
  for (std::size_t i = 1; i <= count; ++i) {
    const float size = static_cast<float>(i) / static_cast<float>(count);
    add_triangle(mesh, {-size, -size, -size}, {size, -size, 0.5f * size}, {0.0f, size, size});
  }
  return mesh;
}

// Each is half as large as the last, towards the origin, 60 times; then they start again.
inline Mesh shrinking_triangles(std::size_t count) {
  Mesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const float size = std::ldexp(1.0f, 10 - static_cast<int>(i % 60));
    add_triangle(mesh, {0.0f, 0.0f, 0.0f}, {size, 0.0f, 0.3f * size}, {0.0f, size, size});
  }
  return mesh;
}

// Long thin triangles in all directions.
inline Mesh sticks(std::size_t count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f);
  Mesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f from{place(random), place(random), place(random)}, to{place(random), place(random), place(random)};
    add_triangle(mesh, from, to, to + Vec3f{0.003f, 0.002f, -0.003f});
  }
  return mesh;
}

inline Mesh points_and_lines(std::size_t count) {
  Mesh mesh = triangle_soup(count, 0.05f, 9);
  for (std::size_t i = 0; i < mesh.positions.size(); i += 3) {
    mesh.positions[i + 1] = mesh.positions[i];
    if (i % 2 == 0) mesh.positions[i + 2] = mesh.positions[i];
  }
  return mesh;
}

inline Mesh quad_among(Mesh mesh) {
  Mesh quad;
  quad.positions = {{-100, -100, -0.5f}, {100, -100, -0.4f}, {-100, 100, -0.5f}, {100, 100, -0.6f}};
  quad.triangles.edit() = {{0, 1, 2}, {1, 3, 2}};
  append(mesh, quad);
  return mesh;
}

inline Mesh teapot_in_stadium() {
  Mesh mesh = scaled(bumpy_sheet(40), 0.01f);
  append(mesh, triangle_soup(300, 60.0f, 3, {0, 0, 0}, 500.0f));
  return mesh;
}

inline Mesh two_clusters() {
  Mesh mesh = triangle_soup(2000, 0.01f, 6);
  append(mesh, triangle_soup(1000, 0.05f, 7, {1e5f, 0, 0}, 2.0f));
  return mesh;
}

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

// Input that every builder must handle in bounded time and memory, with correct hits. Small enough to compare with
// testing every triangle.
inline std::vector<NamedMesh> hard_meshes() {
  std::vector<NamedMesh> list;
  for (std::size_t count : {0u, 1u, 2u, 3u, 4u, 9u}) {
    list.push_back({std::to_string(count) + " triangles", triangle_soup(count, 0.4f)});
  }
  list.push_back({"one centroid", nested_triangles(3000)});
  list.push_back({"shrinking", shrinking_triangles(3000)});
  list.push_back({"duplicates", repeated_triangle(3000)});
  list.push_back({"no area", points_and_lines(1000)});
  list.push_back({"quad among small ones", quad_among(triangle_soup(4000, 0.01f))});
  for (const float factor : {1e-20f, 1e-6f, 1e8f, 1e15f}) {
    list.push_back({"scale " + std::to_string(std::ilogb(factor)), scaled(triangle_soup(1500, 0.1f, 2), factor)});
  }
  list.push_back({"teapot in a stadium", teapot_in_stadium()});
  list.push_back({"two far clusters", two_clusters()});
  list.push_back({"sticks", sticks(2000)});
  list.push_back({"sheet", bumpy_sheet(45)});
  return list;
}

}  // namespace perfect_bvh::test
