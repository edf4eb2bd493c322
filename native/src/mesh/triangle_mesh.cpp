#include "mesh/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

// Areas, products of two extents, must stay finite in float.
constexpr double kLargestCoordinate = 1e18;

std::string to_text(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

template <class T>
void check_positions(std::span<const Vec3<T>> positions, const char* function) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (is_finite(positions[i])) continue;
    throw InvalidArgument(std::string(function) + ": positions[" + std::to_string(i) + "] is not finite, got (" +
                          to_text(positions[i].x) + ", " + to_text(positions[i].y) + ", " + to_text(positions[i].z) +
                          "); remove the triangles that use it, or mend the vertex");
  }
}

void check_range(double largest, const char* function) {
  if (largest <= kLargestCoordinate) return;
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

// One pass without branches where all is well, which is nearly always.
template <class T>
void check_extent(std::span<const Vec3<T>> positions, const char* function) {
  const T limit = static_cast<T>(kLargestCoordinate);
  bool good = true;  // NaN is not
  for (const Vec3<T>& p : positions) {
    good &= std::abs(p.x) <= limit;
    good &= std::abs(p.y) <= limit;
    good &= std::abs(p.z) <= limit;
  }
  if (good) return;
  check_positions(positions, function);
  T largest = 0;
  for (const Vec3<T>& p : positions) largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  check_range(static_cast<double>(largest), function);
}

Vec3d box_centre(std::span<const Vec3d> positions) {
  if (positions.empty()) return {0, 0, 0};
  Vec3d lower = positions[0], upper = positions[0];
  for (const Vec3d p : positions) lower = min(lower, p), upper = max(upper, p);
  return (lower + upper) * 0.5;
}

AlignedVector<Vec3f> narrow(std::span<const Vec3d> positions, Vec3d centre) {
  AlignedVector<Vec3f> narrowed(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) narrowed[i] = to_float(positions[i] - centre);
  return narrowed;
}

void check_count(std::size_t given, std::size_t expected, const char* function) {
  if (given == expected) return;
  throw InvalidArgument(std::string(function) + ": positions has " + std::to_string(given) + " rows but the mesh has " +
                        std::to_string(expected) + " vertices; use replace_mesh for another topology");
}

}  // namespace

TriangleMesh make_mesh(std::span<const Vec3f> positions, std::span<const Vec3<std::int32_t>> triangles,
                       const char* function) {
  check_extent(positions, function);
  TriangleMesh mesh;
  mesh.triangles = copy_triangles(triangles, positions.size(), function);
  mesh.positions.assign(positions.begin(), positions.end());
  return mesh;
}

TriangleMesh make_mesh(std::span<const Vec3d> positions, std::span<const Vec3<std::int32_t>> triangles,
                       const char* function) {
  check_extent(positions, function);
  TriangleMesh mesh;
  mesh.triangles = copy_triangles(triangles, positions.size(), function);
  mesh.centre = box_centre(positions);
  mesh.positions = narrow(positions, mesh.centre);
  return mesh;
}

void set_positions(TriangleMesh& mesh, std::span<const Vec3f> positions, const char* function) {
  check_count(positions.size(), mesh.positions.size(), function);
  check_extent(positions, function);
  mesh.positions.assign(positions.begin(), positions.end());
  mesh.centre = {0, 0, 0};
}

void set_positions(TriangleMesh& mesh, std::span<const Vec3d> positions, const char* function) {
  check_count(positions.size(), mesh.positions.size(), function);
  check_extent(positions, function);
  mesh.centre = box_centre(positions);
  mesh.positions = narrow(positions, mesh.centre);
}

}  // namespace perfect_bvh
