// An owned, validated, indexed triangle mesh in object space.
// In: positions (float or double) and triangles from the caller. Out: copies that no other code can change.
// Double positions are recentred before they are narrowed, so that data a million units from zero keeps its detail:
// object space as the caller knows it is `centre` + stored position.
#pragma once

#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/vec3.h"
#include "mesh/triangle_list.h"

namespace perfect_bvh {

struct TriangleMesh {
  AlignedVector<Vec3f> positions;
  TriangleList triangles;
  Vec3d centre{0, 0, 0};  // zero for meshes given in float

  [[nodiscard]] std::size_t triangle_count() const noexcept { return triangles.size(); }
  [[nodiscard]] Aabb triangle_box(std::size_t index) const noexcept {
    const TriangleIndices t = triangles[index];
    Aabb box;
    box.grow(positions[t.x]), box.grow(positions[t.y]), box.grow(positions[t.z]);
    return box;
  }
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return positions.size() * sizeof(Vec3f) + triangles.size() * sizeof(TriangleIndices);
  }
};

// Copies and checks. `function` opens the error messages ("add_mesh: triangles[17] refers to vertex 512 but
// positions has 500 rows"). Throws InvalidArgument for non-finite positions and indices out of range.
[[nodiscard]] TriangleMesh make_mesh(std::span<const Vec3f> positions, std::span<const Vec3<std::int32_t>> triangles,
                                     const char* function);
[[nodiscard]] TriangleMesh make_mesh(std::span<const Vec3d> positions, std::span<const Vec3<std::int32_t>> triangles,
                                     const char* function);

// Parts of the same, for code that moves the vertices of a mesh: throws InvalidArgument if there are not `expected`
// positions, or for the first that is not good.
void check_count(std::size_t given, std::size_t expected, const char* function);
template <class T>
void check_positions(std::span<const Vec3<T>> positions, const char* function);
template <class T>
[[nodiscard]] bool are_good(std::span<const Vec3<T>> positions) noexcept;
[[nodiscard]] Vec3d box_centre(std::span<const Vec3d> positions) noexcept;
void narrow(std::span<const Vec3d> positions, Vec3d centre, Vec3f* narrowed) noexcept;

}  // namespace perfect_bvh
