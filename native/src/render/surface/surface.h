// The points that a batch of rays hit, with what shading needs to know of them.
// In: rays and hits. Out: one record for each hit, in double where position matters and in float elsewhere.
#pragma once

#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "query/trace.h"
#include "render/appearance/appearance.h"

namespace perfect_bvh {

// What a shading mode or a pass will use; nothing else is worked out.
struct SurfaceNeeds {
  bool normals = false;    // both normals
  bool origins = false;    // where secondary rays start; needs the normals
  bool materials = false;  // the material's row and colour
  bool holdouts = false;   // points on holdouts, too: light knows nothing of them

  friend constexpr SurfaceNeeds operator|(SurfaceNeeds a, SurfaceNeeds b) noexcept {
    return {a.normals || b.normals, a.origins || b.origins, a.materials || b.materials, a.holdouts || b.holdouts};
  }
};

struct SurfacePoint {
  std::uint32_t ray = 0;  // row of the ray and the hit
  std::int32_t material = kNoMaterial;
  float time = kShutterOpens;       // when it was hit: all that leaves it is of that time
  Vec3f geometric_normal{0, 0, 0};  // world space, unit length, towards the viewer
  // The same from corner normals, if the mesh has them. Its side follows the triangle's winding, as in Cycles.
  Vec3f normal{0, 0, 0};
  // For light: as `normal`, but on the viewer's side too where single triangles of a mesh are turned round.
  Vec3f light_normal{0, 0, 0};
  Vec3f color{0, 0, 0};  // of the material
  Vec3f along{0, 0, 0};  // of curves: unit length, towards the tip
  bool inside = false;   // the viewer looks at the side that the mesh's winding makes the inner one
  // Off the surface towards the viewer, so far that no rounding brings a ray from here back to its own triangle.
  Vec3d origin{0, 0, 0};
  Vec3f lift{0, 0, 0};    // from there to the curved surface that smooth normals suggest, where that lies higher
  Vec3d beyond{0, 0, 0};  // the same on the other side, for light that passes the surface
  // Of hair, which light passes through: the curve's instance and segment, which tell where it comes out.
  const Instance* strand = nullptr;
  std::uint32_t segment = 0;
};

inline constexpr Vec3f kPlainColor{0.8f, 0.8f, 0.8f};  // where there is no material

// The colour of a row of the material table, or kPlainColor for kNoMaterial.
[[nodiscard]] Vec3f material_color(const Appearance& appearance, std::int32_t material) noexcept;

// Appends a point for each hit, on holdouts only if they are needed.
void find_surfaces(const Snapshot& snapshot, const Appearance& appearance, SurfaceNeeds needs,
                   std::span<const Ray> rays, std::span<const Hit> hits, AlignedVector<SurfacePoint>& points);

}  // namespace perfect_bvh
