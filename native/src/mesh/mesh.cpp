#include "mesh/mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

// Areas, which are products of two extents, must stay finite in float.
constexpr double kLargestCoordinate = 1e18;

std::string to_text(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

template <class T>
[[noreturn]] void complain(std::span<const Vec3<T>> positions, const char* function) {
  T largest = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3<T>& p = positions[i];
    largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    if (is_finite(p)) continue;
    throw InvalidArgument(std::string(function) + ": positions[" + std::to_string(i) + "] is not finite, got (" +
                          to_text(p.x) + ", " + to_text(p.y) + ", " + to_text(p.z) +
                          "); remove the triangles that use it, or correct the vertex");
  }
  throw InvalidArgument(std::string(function) + ": positions must stay below 1e18 in magnitude, got " +
                        to_text(largest) + "; scale the mesh down and its instances up");
}

AlignedVector<TriangleIndices> copy_triangles(std::span<const Vec3<std::int32_t>> triangles, std::size_t vertex_count,
                                              const char* function) {
  AlignedVector<TriangleIndices> copies(triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::int32_t vertex = triangles[i][corner];
      if (vertex >= 0 && static_cast<std::size_t>(vertex) < vertex_count) continue;
      throw InvalidArgument(std::string(function) + ": triangles[" + std::to_string(i) + "] refers to vertex " +
                            std::to_string(vertex) + " but positions has " + std::to_string(vertex_count) + " rows");
    }
    copies[i] = {static_cast<std::uint32_t>(triangles[i].x), static_cast<std::uint32_t>(triangles[i].y),
                 static_cast<std::uint32_t>(triangles[i].z)};
  }
  return copies;
}

template <class T>
Mesh begin_mesh(std::span<const Vec3<T>> positions, std::span<const Vec3<std::int32_t>> triangles,
                const char* function) {
  check_positions(positions, function);
  Mesh mesh;
  mesh.triangles = copy_triangles(triangles, positions.size(), function);
  mesh.positions.resize(positions.size());
  return mesh;
}

}  // namespace

void check_count(std::size_t given, std::size_t expected, const char* function) {
  if (given == expected) return;
  throw InvalidArgument(std::string(function) + ": positions has " + std::to_string(given) + " rows but the mesh has " +
                        std::to_string(expected) + " vertices; use replace_mesh for another topology");
}

template <class T>
void check_positions(std::span<const Vec3<T>> positions, const char* function) {
  if (!are_good(positions)) complain(positions, function);
}
template void check_positions(std::span<const Vec3f>, const char*);
template void check_positions(std::span<const Vec3d>, const char*);

// Without a branch, to check several numbers at once.
template <class T>
bool are_good(std::span<const Vec3<T>> positions) noexcept {
  static_assert(sizeof(Vec3<T>) == 3 * sizeof(T));
  const T* const numbers = reinterpret_cast<const T*>(positions.data());
  const T limit = static_cast<T>(kLargestCoordinate);
  std::uint32_t wrong = 0;  // as for NaN
  for (std::size_t i = 0; i < 3 * positions.size(); ++i) wrong |= std::abs(numbers[i]) <= limit ? 0u : 1u;
  return wrong == 0;
}
template bool are_good(std::span<const Vec3f>) noexcept;
template bool are_good(std::span<const Vec3d>) noexcept;

Vec3d box_centre(std::span<const Vec3d> positions) noexcept {
  if (positions.empty()) return {0, 0, 0};
  Vec3d lower = positions[0], upper = positions[0];
  for (const Vec3d p : positions) lower = min(lower, p), upper = max(upper, p);
  return (lower + upper) * 0.5;
}

void narrow(std::span<const Vec3d> positions, Vec3d centre, Vec3f* narrowed) noexcept {
  for (std::size_t i = 0; i < positions.size(); ++i) narrowed[i] = to_float(positions[i] - centre);
}

Mesh make_mesh(std::span<const Vec3f> positions, std::span<const Vec3<std::int32_t>> triangles, const char* function) {
  Mesh mesh = begin_mesh(positions, triangles, function);
  std::copy(positions.begin(), positions.end(), mesh.positions.begin());
  return mesh;
}

Mesh make_mesh(std::span<const Vec3d> positions, std::span<const Vec3<std::int32_t>> triangles, const char* function) {
  Mesh mesh = begin_mesh(positions, triangles, function);
  mesh.centre = box_centre(positions);
  narrow(positions, mesh.centre, mesh.positions.data());
  return mesh;
}

}  // namespace perfect_bvh
