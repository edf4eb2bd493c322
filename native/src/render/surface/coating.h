// The layers on top of a surface: fibers of cloth or dust (sheen), and below them a clear coat.
// In: a finish, normals, the direction to the viewer. Out: as for Bsdf, and the share of light left for the layers
// below.
// Sheen is a linearly transformed cosine (Zeltner et al. 2022, "Practical Multiple-Scattering Sheen Using Linearly
// Transformed Cosines"). A coat is GGX facets of a dielectric that lose the light scattered between them, as in Cycles.
#pragma once

#include "render/sampling/sampler.h"
#include "render/surface/microfacets.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

// A cosine lobe sheared and scaled towards a viewer at this cosine, and its total reflectance.
struct SheenLobe {
  float scale, shear, albedo;
};
[[nodiscard]] SheenLobe sheen_lobe(float cosine, float roughness) noexcept;

class Coating {
 public:
  // Light by the cosine, per solid angle; and the density with which a direction is chosen.
  struct Value {
    Vec3f light{0, 0, 0};
    float density = 0.0f;
  };
  // The geometry of the base: the shading normal, the triangle's normal, and the direction to the viewer.
  struct Place {
    Vec3f normal, geometric_normal, view;
  };

  // least_alpha, has_coat: see Bsdf::Limits.
  Coating(const Material& material, const Finish& finish, const Place& place, float least_alpha,
          bool has_coat) noexcept;

  // Returns the share of light left for the layers below.
  [[nodiscard]] Vec3f below() const noexcept { return below_; }
  [[nodiscard]] Vec3f sheen_albedo() const noexcept { return sheen_; }
  [[nodiscard]] Vec3f coat_albedo() const noexcept { return coat_albedo_; }
  [[nodiscard]] bool has_smooth_coat() const noexcept { return facets_.narrower_than(kSmoothAlpha); }

  [[nodiscard]] Value sheen(Vec3f direction) const noexcept;
  [[nodiscard]] Value coat(Vec3f direction) const noexcept;
  [[nodiscard]] Vec3f choose_sheen(Point2 random) const noexcept;
  struct Mirrored {
    Vec3f direction, weight;  // the weight of a smooth coat
  };
  [[nodiscard]] Mirrored choose_coat(Point2 random) const noexcept;

 private:
  void add_sheen(const Finish& finish, Vec3f view) noexcept;
  void add_coat(const Finish& finish) noexcept;

  Frame fibers_, layer_;  // about the normals of sheen and coat
  Vec3f view_;            // in `layer_`
  Facets facets_;
  float ior_, scale_ = 1.0f, shear_ = 0.0f;
  Vec3f sheen_{0, 0, 0}, coat_{0, 0, 0}, coat_albedo_{0, 0, 0}, below_{1, 1, 1};
};

}  // namespace perfect_bvh
