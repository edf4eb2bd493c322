// An owned, validated, indexed triangle mesh in object space.
// In: positions (float or double) and triangles from the caller. Out: copies that nobody else can change.
// Double positions are recentred before they are narrowed, so that data a million units from zero keeps its detail:
// object space as the caller knows it is `centre` + stored position.
#pragma once

#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/vec3.h"

namespace perfect_bvh {

using TriangleIndices = Vec3<std::uint32_t>;

struct TriangleMesh {
  AlignedVector<Vec3f> positions;
  AlignedVector<TriangleIndices> triangles;
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

// New positions for the same triangles, checked. Changes the mesh only if they are good.
void set_positions(TriangleMesh& mesh, std::span<const Vec3f> positions, const char* function);
void set_positions(TriangleMesh& mesh, std::span<const Vec3d> positions, const char* function);

}  // namespace perfect_bvh
