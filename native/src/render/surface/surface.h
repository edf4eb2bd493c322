// The material of a surface at a ray's hit: its scattering properties, emission, and alpha.
// In: a hit and the scene's appearance. Out: numbers, with images looked up.
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

// Shares of a surface: `metallic` is metal; of the rest, `transmission` is clear; of the rest, `translucency` scatters
// to the other side. The remainder is diffuse below a dielectric reflection.
struct Material {
  Vec3f color{0, 0, 0};     // of the diffuse base
  Vec3f emission{0, 0, 0};  // radiance
  float roughness = 1.0f;   // of everything that is not diffuse
  float metallic = 0.0f;
  Vec3f metal{1, 1, 1};          // reflectance of the metal along the normal
  float even_metal = 0.0f;       // share of the metal that reflects equally at all angles
  float reflectance = 0.0f;      // of the dielectric, along the normal
  Vec3f specular_tint{1, 1, 1};  // of that reflection; for metal, of its reflection at 82 degrees
  float transmission = 0.0f;
  float ior = 1.5f;               // refractive index of the clear share
  Vec3f tint{1, 1, 1};            // of light that enters it
  float tinted_glass = 0.0f;      // share of it that also tints its reflection
  float plain_refraction = 0.0f;  // share of it that reflects nothing
  float lossy_facets = 0.0f;      // share of light lost between facets
  float translucency = 0.0f;
  Vec3f translucent{0, 0, 0};  // the share of all incident light that is scattered to the other side
  float alpha = 1.0f;
  std::optional<Finish> finish = std::nullopt;
  // For a finish: the direction of brushed structure, and the normal of a coat. Zero unless a program sets them.
  Vec3f tangent{0, 0, 0}, coat_normal{0, 0, 0};
  const Hair* hair = nullptr;  // for strands: replaces the surface properties
  float surface = 1.0f;        // on strands, the share of an ordinary surface; the rest is hair
  float holdout = 0.0f;        // the share that cuts a hole: it hides everything behind, and adds no alpha

  // Returns the share of light that passes straight through.
  [[nodiscard]] float through() const noexcept { return 1.0f - alpha; }
  // Returns its contribution to the image's alpha.
  [[nodiscard]] float shown() const noexcept { return alpha * (1.0f - holdout); }
};

// Returns the hit's position in one of the mesh's uv maps; none without that map.
[[nodiscard]] std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                                          std::int32_t map = 0);

// Surface -------------------------------------------------------------------------------------------------------------
// The points that a batch of rays hit, with the data that shading needs.
// In: rays and hits. Out: one record for each hit, in double where the position matters and in float elsewhere.

// The data that a shading mode or a pass uses; nothing else is computed.
struct SurfaceNeeds {
  bool normals = false;    // both normals
  bool origins = false;    // origins of secondary rays; needs the normals
  bool materials = false;  // the material's row and colour
  bool holdouts = false;   // also points on holdouts, which lighting ignores

  friend constexpr SurfaceNeeds operator|(SurfaceNeeds a, SurfaceNeeds b) noexcept {
    return {a.normals || b.normals, a.origins || b.origins, a.materials || b.materials, a.holdouts || b.holdouts};
  }
};

struct SurfacePoint {
  std::uint32_t ray = 0;  // row of the ray and the hit
  std::int32_t material = kNoMaterial;
  float time = kShutterOpens;       // of the hit; everything that leaves it has this time
  Vec3f geometric_normal{0, 0, 0};  // world space, unit length, towards the viewer
  // The same from corner normals, if the mesh has them. Its side follows the triangle's winding, as in Cycles.
  Vec3f normal{0, 0, 0};
  // For lighting: like `normal`, but also on the viewer's side if single triangles of a mesh are flipped.
  Vec3f light_normal{0, 0, 0};
  Vec3f mesh_normal{0, 0, 0};  // `light_normal` before nodes bent it
  Vec3f color{0, 0, 0};        // of the material
  Vec3f along{0, 0, 0};        // for curves: unit length, towards the tip
  bool inside = false;         // the viewer sees the inner side by the mesh's winding
  double pixel = 0.0;          // the width of a pixel at the end of a path; 0: the ray comes from the camera
  // Off the surface towards the viewer, far enough that rounding cannot bring a ray from here back to its own triangle.
  Vec3d origin{0, 0, 0};
  Vec3f lift{0, 0, 0};    // from there to the curved surface implied by smooth normals
  Vec3d beyond{0, 0, 0};  // the same two on the other side, for light that passes the surface
  Vec3f lift_beyond{0, 0, 0};
  // Of a ribbon. Rays that leave it skip ribbons nearer than this, as in Cycles: itself, and strands that lie on it,
  // which would darken each other.
  float ribbon_width = 0.0f;
  // For hair, which light passes through: the curve's instance and segment, to find the exit point.
  const Instance* strand = nullptr;
  std::uint32_t segment = 0;
};

inline constexpr Vec3f kPlainColor{0.8f, 0.8f, 0.8f};  // without a material

// Returns the colour of a row of the material table, or kPlainColor for kNoMaterial.
[[nodiscard]] Vec3f material_color(const Appearance& appearance, std::int32_t material) noexcept;

// Returns a ray that hits a point along its normal, to evaluate materials without a viewer.
[[nodiscard]] Ray ray_onto(const Snapshot& snapshot, const Hit& hit, float time = kShutterOpens) noexcept;

// Evaluates one hit; `row` is the material's in the tables, or kNoMaterial.
[[nodiscard]] Material material_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray,
                                   const Hit& hit, std::int32_t row);

// Evaluates only the alpha, and runs only the nodes that lead to it.
[[nodiscard]] float alpha_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit,
                             std::int32_t row);

// Evaluates materials, and the normals that their nodes bend; reuses its memory for the next batch.
class MaterialReader {
 public:
  // points: those of these rays and hits, with normals and materials. Returns the materials in their order, valid until
  // the next call.
  std::span<Material> read(const Snapshot& snapshot, const Appearance& appearance, std::span<const Ray> rays,
                           std::span<const Hit> hits, std::span<SurfacePoint> points);

 private:
  std::vector<Material> materials_;
  std::vector<std::uint32_t> order_;  // of points with programs, by material
  NodeRun run_;
};

// Appends a point for each hit; on holdouts only if they are needed.
void find_surfaces(const Snapshot& snapshot, const Appearance& appearance, SurfaceNeeds needs,
                   std::span<const Ray> rays, std::span<const Hit> hits, AlignedVector<SurfacePoint>& points);

}  // namespace perfect_bvh
