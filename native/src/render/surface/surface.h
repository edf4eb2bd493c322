// What a surface is made of where a ray hit it, its own light, and how much of it is there at all.
// In: a hit and the scene's appearance. Out: numbers, images looked up.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/aligned.h"
#include "query/trace.h"
#include "render/appearance/appearance.h"
#include "render/surface/run_nodes.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Shares of a surface: `metallic` is metal; of the rest `transmission` is clear; of the rest `translucency` scatters to
// the other side; what remains is diffuse below a dielectric reflection.
struct Material {
  Vec3f color{0, 0, 0};     // of the diffuse base
  Vec3f emission{0, 0, 0};  // radiance
  float roughness = 1.0f;   // of all that is not diffuse
  float metallic = 0.0f;
  Vec3f metal{1, 1, 1};          // what metal reflects seen from straight above
  float even_metal = 0.0f;       // how much of the metal reflects so at all angles
  float reflectance = 0.0f;      // of the dielectric, seen from straight above
  Vec3f specular_tint{1, 1, 1};  // of that reflection; of what metal reflects at 82 degrees
  float transmission = 0.0f;
  float ior = 1.5f;               // refractive index of what is clear
  Vec3f tint{1, 1, 1};            // of what passes into it
  float tinted_glass = 0.0f;      // how much of it tints what it reflects, too
  float plain_refraction = 0.0f;  // how much of it reflects nothing
  float lossy_facets = 0.0f;      // share of light that facets scatter at each other and that is lost
  float translucency = 0.0f;
  Vec3f translucent{0, 0, 0};  // of all the light that meets the surface, what is scattered to the other side
  float alpha = 1.0f;
  std::optional<Finish> finish = std::nullopt;
  // Of a finish: along brushed structure, and the normal of a coat. Zero where no program sets them.
  Vec3f tangent{0, 0, 0}, coat_normal{0, 0, 0};
  const Hair* hair = nullptr;  // what strands are of instead
  float surface = 1.0f;        // how much of the surface there is: on strands, beside hair
  float holdout = 0.0f;        // of what is there, how much cuts a hole: it hides what is behind, and adds no alpha

  // What passes by it, as if nothing was there.
  [[nodiscard]] float through() const noexcept { return 1.0f - alpha; }
  // What it adds to the image's alpha.
  [[nodiscard]] float shown() const noexcept { return alpha * (1.0f - holdout); }
};

// Where in one of the mesh's uv maps a hit lies; none without that map.
[[nodiscard]] std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                          std::int32_t map = 0);

// Surface -------------------------------------------------------------------------------------------------------------
// The points that a batch of rays hit, with what shading needs to know of them.
// In: rays and hits. Out: one record for each hit, in double where position matters and in float elsewhere.

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
  Vec3f mesh_normal{0, 0, 0};  // what that was before nodes bent it
  Vec3f color{0, 0, 0};        // of the material
  Vec3f along{0, 0, 0};        // of curves: unit length, towards the tip
  bool inside = false;         // the viewer looks at the side that the mesh's winding makes the inner one
  // Off the surface towards the viewer, so far that no rounding brings a ray from here back to its own triangle.
  Vec3d origin{0, 0, 0};
  Vec3f lift{0, 0, 0};    // from there to the curved surface that smooth normals suggest
  Vec3d beyond{0, 0, 0};  // the same two on the other side, for light that passes the surface
  Vec3f lift_beyond{0, 0, 0};
  // Of hair, which light passes through: the curve's instance and segment, which tell where it comes out.
  const Instance* strand = nullptr;
  std::uint32_t segment = 0;
};

inline constexpr Vec3f kPlainColor{0.8f, 0.8f, 0.8f};  // where there is no material

// The colour of a row of the material table, or kPlainColor for kNoMaterial.
[[nodiscard]] Vec3f material_color(const Appearance& appearance, std::int32_t material) noexcept;

// A ray that meets a hit straight on, for materials that nobody looks at.
[[nodiscard]] Ray ray_onto(const Snapshot& snapshot, const Hit& hit, float time = kShutterOpens) noexcept;

// Of one hit; `row` is the material's in the tables, or kNoMaterial.
[[nodiscard]] Material material_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray,
                                   const Hit& hit, std::int32_t row);

// The alpha of the same alone: of its nodes no others are run than those which lead to it.
[[nodiscard]] float alpha_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit,
                             std::int32_t row);

// Works out materials, and the normals that their nodes bend; its memory is kept for the next batch.
class MaterialReader {
 public:
  // points: of these rays and hits, with normals and materials. In their order, until the next call.
  std::span<Material> read(const Snapshot& snapshot, const Appearance& appearance, std::span<const Ray> rays,
                           std::span<const Hit> hits, std::span<SurfacePoint> points);

 private:
  std::vector<Material> materials_;
  std::vector<std::uint32_t> order_;  // of points with programs, by material
  NodeRun run_;
};

// Appends a point for each hit, on holdouts only if they are needed.
void find_surfaces(const Snapshot& snapshot, const Appearance& appearance, SurfaceNeeds needs,
                   std::span<const Ray> rays, std::span<const Hit> hits, AlignedVector<SurfacePoint>& points);

}  // namespace perfect_bvh
