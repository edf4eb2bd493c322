// The scattering of a surface: Cycles' Principled BSDF with base colour, metal, roughness, index of refraction and
// transmission, and the plain Diffuse, Glossy, Glass, Refraction and Translucent BSDFs as special cases.
// In: a material at a hit, the normal, the direction to the viewer. Out: for a direction, the share of light seen from
// there; or a random direction, more likely if more is seen from there.
// Layers from top to bottom: rough facets (microfacets.h) that reflect as metal, as a dielectric over diffuse, or as
// glass. Glass refracts the rest. The diffuse base gets the light that the facets do not reflect (Burley 2015; Turquin
// 2019). A finish may be on top of all of them (coating.h), and roughen the diffuse base.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "render/sampling/sampler.h"
#include "render/surface/coating.h"
#include "render/surface/hair_bsdf.h"
#include "render/surface/microfacets.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

enum class Scatter : std::uint8_t { kNone, kDiffuse, kGlossy, kTranslucent, kRefracted };

// The reflection of a rough diffuse surface, relative to an even one: Oren and Nayar's facets in the form of Fujii
// 2012, with the light between them as in Portsmouth et al. 2024 ("EON"). In: cosines to the normal, and between both
// directions.
class RoughDiffuse {
 public:
  RoughDiffuse() = default;
  RoughDiffuse(float roughness, Vec3f color, float view_cosine) noexcept;

  [[nodiscard]] bool is_even() const noexcept { return !(slope_ > 0.0f); }
  [[nodiscard]] Vec3f operator()(float light_cosine, float between) const noexcept;

 private:
  // Returns the share of light that leaves white facets directly.
  [[nodiscard]] float albedo(float cosine) const noexcept;

  float even_ = 1.0f, slope_ = 0.0f, view_cosine_ = 1.0f;
  Vec3f bounced_{0, 0, 0};
};

class Bsdf {
 public:
  struct Value {
    // The contribution of a light to a surface's colour, relative to LightRay::light; for a strand, relative to a light
    // that shines on all sides of it, without the cosine.
    Vec3f share{0, 0, 0};
    float density = 0.0f;  // probability density of the direction in `sample`, over solid angle
  };
  struct Sample {
    Scatter kind = Scatter::kNone;  // none: nothing is scattered
    Vec3f direction{0, 0, 1};
    Vec3f weight{0, 0, 0};   // of light from there
    float density = 0.0f;    // infinite if a smooth surface has only one direction: `evaluate` is then 0
    bool is_strand = false;  // for a strand, which light leaves on any side for every kind
  };
  // The values for a denoiser's guides.
  struct Albedo {
    Vec3f plain{0, 0, 0}, mirrored{0, 0, 0};
    float plain_share = 0.0f, mirrored_share = 0.0f;  // of the scattered light, by its weight
  };

  // Parts that are left out.
  struct Limits {
    float least_alpha = 0.0f;  // minimum width of the facets' slopes
    bool no_reflection = false, no_refraction = false;
  };

  // normal, geometric_normal, view: unit length. The triangle's own normal is on the viewer's side; so is the other, in
  // most cases.
  // inside: the viewer sees the mesh's inner side.
  Bsdf(const Material& material, Vec3f normal, Vec3f geometric_normal, Vec3f view, bool inside,
       const Limits& limits) noexcept;

  // Sets the mesh's normal, from which nodes have bent the shading normal away. Light that only one of them faces is
  // not seen, and diffuse light from the side is darkened (Conty Estevez et al. 2019, "A Microfacet-Based Shadowing
  // Function to Solve the Bump Terminator Problem").
  void set_mesh_normal(Vec3f mesh_normal) noexcept { mesh_normal_ = local(mesh_normal), is_bent_ = true; }
  // Makes it a strand: a mix of the previous surface and hair.
  void add_hair(const HairBsdf& hair) noexcept;
  [[nodiscard]] bool is_strand() const noexcept { return hair_.has_value(); }

  [[nodiscard]] Value evaluate(Vec3f direction) const noexcept;
  // Evaluates without the facets' reflection and refraction: for light that only diffuse rays see.
  [[nodiscard]] Value evaluate_diffuse(Vec3f direction) const noexcept;
  // pick: 0 to 1, independent of `random`.
  [[nodiscard]] Sample sample(float pick, Point2 random) const noexcept;
  // Returns whether light from the normal's other side may be seen: facets with a bent normal may mirror it.
  [[nodiscard]] bool transmits() const noexcept {
    return is_strand() || chances_.translucent > 0.0f || chances_.refracted > 0.0f ||
           (chances_.glossy > 0.0f && normal_.z < kUpright);
  }
  [[nodiscard]] bool is_black() const noexcept { return !(total_ > 0.0f); }
  [[nodiscard]] Albedo albedo() const noexcept;

 private:
  // The weights of the choices in `sample`, not normalized.
  struct Chances {
    float diffuse = 0.0f, glossy = 0.0f, translucent = 0.0f, refracted = 0.0f, sheen = 0.0f, coat = 0.0f, hair = 0.0f;
  };

  void layer(const Material& material, bool inside, const Limits& limits) noexcept;
  void add_metal(const Material& material) noexcept;
  // Returns the share of light left for the layers below.
  float add_dielectric(const Material& material, float share) noexcept;
  void add_glass(const Material& material, float share, bool inside, const Limits& limits) noexcept;
  // Puts the finish on top.
  void add_finish(const Material& material, const Coating::Place& place, const Limits& limits) noexcept;
  [[nodiscard]] Vec3f diffuse(Vec3f out, float height) const noexcept;
  void evaluate_coating(Vec3f out, float height, Value& value) const noexcept;
  // Returns whether a direction is on one side of the mesh's normal and on the other of a bent one.
  [[nodiscard]] bool leaks(Vec3f out, Vec3f normal) const noexcept {
    return is_bent_ && dot(out, mesh_normal_) * dot(normal, mesh_normal_) * dot(out, normal) < 0.0f;
  }
  [[nodiscard]] bool has_facets() const noexcept { return chances_.glossy > 0.0f || chances_.refracted > 0.0f; }
  // Returns the visible share of diffuse light from a direction.
  [[nodiscard]] float seen_of(Vec3f out, Vec3f normal) const noexcept {
    return is_bent_ ? seen_of_bent(out, normal) : 1.0f;
  }
  [[nodiscard]] float seen_of_bent(Vec3f out, Vec3f normal) const noexcept;
  [[nodiscard]] Vec3f reflected(float cosine) const noexcept;
  [[nodiscard]] Vec3f passed(float cosine) const noexcept;
  // In the facets' frame. height: along the normal. slant: the same on either side. These add to `value`.
  void evaluate_plain(Vec3f out, float height, Value& value) const noexcept;
  void evaluate_translucent(Vec3f out, float height, Value& value) const noexcept;
  void evaluate_reflected(Vec3f out, float slant, Value& value) const noexcept;
  void evaluate_refracted(Vec3f out, float slant, Value& value) const noexcept;
  [[nodiscard]] Value evaluate_local(Vec3f out) const noexcept;
  [[nodiscard]] Value evaluate_strand(Vec3f direction, Value surface, HairBsdf::Value hair) const noexcept;
  [[nodiscard]] Sample sample_strand(float pick, Point2 random) const noexcept;
  [[nodiscard]] Sample sample_surface(float left, Point2 random) const noexcept;
  [[nodiscard]] Vec3f local(Vec3f world) const noexcept {
    return {dot(world, frame_.x), dot(world, frame_.y), dot(world, frame_.z)};
  }
  [[nodiscard]] Sample sample_facet(Point2 random, bool refract) const noexcept;
  [[nodiscard]] bool is_smooth() const noexcept { return facets_.narrower_than(kSmoothAlpha); }

  static constexpr float kUpright = 1.0f - 1e-6f;

  Frame frame_;          // of the facets: about the normal, bent if they would mirror below the surface
  Vec3f normal_, view_;  // in the frame
  Vec3f mesh_normal_{0, 0, 1};
  bool is_bent_ = false;
  Facets facets_;
  float roughness_, kept_;  // kept: share of the light bounced between facets
  // Colours of the layers, each including the light bounced between its facets.
  MetalFresnel metal_;
  Vec3f metal_share_{0, 0, 0}, even_{0, 0, 0};
  DielectricFresnel dielectric_;
  Vec3f dielectric_share_{0, 0, 0};
  DielectricFresnel glass_;
  Vec3f glass_reflection_{0, 0, 0}, glass_refraction_{0, 0, 0}, plain_refraction_{0, 0, 0};
  Vec3f diffuse_{0, 0, 0}, translucent_{0, 0, 0};
  Vec3f glossy_albedo_{0, 0, 0}, refracted_albedo_{0, 0, 0};
  RoughDiffuse rough_;
  std::optional<Coating> coating_;
  std::optional<HairBsdf> hair_;
  Chances chances_;
  float total_ = 0.0f;
};

}  // namespace perfect_bvh
