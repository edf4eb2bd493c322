// The share of light reflected by a smooth boundary.
// In: the cosine between the normal and the direction to the viewer; the ratio of the refractive indices, far side over
// viewer's side. Out: shares, 0 to 1. The rest passes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "math/elementary.h"
#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// Along the normal.
[[nodiscard]] inline float reflectance_of(float ior) noexcept {
  const float root = (ior - 1.0f) / (ior + 1.0f);
  return root * root;
}
[[nodiscard]] inline float ior_of(float reflectance) noexcept {
  const float root = std::sqrt(std::clamp(reflectance, 0.0f, 0.99f));
  return (1.0f + root) / (1.0f - root);
}

struct Fresnel {
  float reflected = 1.0f;
  float cosine = 0.0f;  // between the refracted direction and the opposite normal; 0 if all is reflected
};
// For unpolarized light.
[[nodiscard]] inline Fresnel fresnel(float cosine, float ior) noexcept {
  const float square = 1.0f - (1.0f - cosine * cosine) / (ior * ior);
  if (!(square > 0.0f)) return {};
  const float refracted = std::sqrt(square);
  const float across = (cosine - ior * refracted) / (cosine + ior * refracted);
  const float along = (ior * cosine - refracted) / (ior * cosine + refracted);
  return {0.5f * (across * across + along * along), refracted};
}

// A boundary whose reflection along the normal is tinted; at grazing angles it is white.
class DielectricFresnel {
 public:
  DielectricFresnel() = default;
  DielectricFresnel(float ior, Vec3f tint) noexcept
      : ior_(ior), least_(reflectance_of(ior)), reflectance_(tint * least_) {}

  [[nodiscard]] float ior() const noexcept { return ior_; }
  [[nodiscard]] Vec3f operator()(float cosine) const noexcept { return risen(rise(fresnel(cosine, ior_).reflected)); }
  // Converts a share of light to a position from the reflection along the normal (0) to full reflection (1).
  [[nodiscard]] float rise(float share) const noexcept {
    return least_ < 1.0f ? std::max((share - least_) / (1.0f - least_), 0.0f) : 1.0f;
  }
  [[nodiscard]] Vec3f risen(float rise) const noexcept { return reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * rise; }

 private:
  float ior_ = 1.0f, least_ = 0.0f;
  Vec3f reflectance_{0, 0, 0};
};

// Returns how far a metal's reflection has risen from that along the normal to full reflection (Schlick 1994).
[[nodiscard]] inline float schlick_rise(float cosine) noexcept {
  const float rest = 1.0f - std::clamp(cosine, 0.0f, 1.0f), square = rest * rest;
  return square * square * rest;
}

// A metal that reflects, at 82 degrees, `edge` times the value of Schlick's formula (Kutz et al. 2021, "F82-tint").
class MetalFresnel {
 public:
  MetalFresnel() = default;
  MetalFresnel(Vec3f reflectance, Vec3f edge) noexcept : reflectance_(reflectance) {
    constexpr float kRest = 6.0f / 7.0f, kRise = kRest * kRest * kRest * kRest * kRest;
    const Vec3f schlick = reflectance + (Vec3f{1, 1, 1} - reflectance) * kRise;
    dip_ = schlick * (Vec3f{1, 1, 1} - edge) * (7.0f / (kRise * kRest));
  }
  [[nodiscard]] Vec3f operator()(float cosine) const noexcept {
    const float rise = schlick_rise(cosine);
    const Vec3f all = reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * rise;
    return max(all - dip_ * (cosine * rise * (1.0f - cosine)), Vec3f{0, 0, 0});
  }
  [[nodiscard]] Vec3f mean() const noexcept {
    return reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * (1.0f / 21.0f) - dip_ * (1.0f / 126.0f);
  }
  // For rough metal, with the rise of its facets' reflection from that along the normal.
  [[nodiscard]] Vec3f risen(float rise) const noexcept { return reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * rise; }

 private:
  Vec3f reflectance_{0, 0, 0}, dip_{0, 0, 0};
};

// Returns the mean reflection of a boundary with this index above 1, over directions of uniform incident light (the fit
// of d'Eon 2021).
[[nodiscard]] inline float mean_fresnel(float ior) noexcept { return (ior - 1.0f) / (4.08567f + 1.00071f * ior); }

// Microfacets ---------------------------------------------------------------------------------------------------------
// Rough surfaces as facets, each a mirror or a pane (Walter et al. 2007): the GGX distribution of their slopes, their
// visibility, and their total reflection. In: vectors in the frame of the surface's normal (z), on its side; alpha, the
// width of the slopes. Out: densities over solid angle and shares.

inline constexpr float kSmoothAlpha = 5e-4f;  // narrower slopes count as a single direction

enum class FacetKind : std::uint8_t { kGgx, kBeckmann, kAshikhminShirley };

class Facets {
 public:
  explicit Facets(float alpha) noexcept : along_(alpha), across_(alpha), product_(alpha * alpha) {}
  // along, across: widths along the frame's x and y.
  Facets(float along, float across, FacetKind kind) noexcept
      : along_(along),
        across_(across),
        product_(along * across),
        narrower_(across / along),
        wider_(along / across),
        kind_(kind) {}

  [[nodiscard]] bool narrower_than(float alpha) const noexcept { return product_ < alpha * alpha; }

  // Returns the density of normals over solid angle. Computed from the sine rather than the cosine, which loses all
  // digits for small slopes.
  [[nodiscard]] float density(Vec3f normal) const noexcept {
    const float slope = normal.x * normal.x * narrower_ + normal.y * normal.y * wider_;
    const float spread = normal.z * normal.z * product_ + slope;
    return product_ * std::numbers::inv_pi_v<float> / (spread * spread);
  }
  // Returns the density of normals from `choose_seen`.
  [[nodiscard]] float seen_density(Vec3f view, Vec3f normal) const noexcept {
    if (kind_ != FacetKind::kGgx) return density_of_other(normal);
    return density(normal) * std::max(dot(view, normal), 0.0f) / (view.z * (1.0f + hidden(view)));
  }
  // Returns the light that facets of this normal reflect from a direction to the viewer, relative to the case in which
  // `choose_seen` has the density of visible facets and all of them are lit. For GGX, this is the lit share of the
  // visible part, with correlated heights (Heitz 2014).
  [[nodiscard]] float lit_of_seen(Vec3f view, Vec3f light, Vec3f normal) const noexcept {
    if (kind_ != FacetKind::kGgx) return lit_of_other(view, light, normal);
    const float seen = 1.0f + hidden(view);
    return seen / (seen + hidden(light));
  }
  // Samples a facet's normal: for GGX by visible area (Heitz 2018; Dupuy and Benyoub 2023), for others by area.
  [[nodiscard]] Vec3f choose_seen(Vec3f view, Point2 random) const noexcept {
    if (kind_ != FacetKind::kGgx) return choose_other(random);
    const Vec3f stretched = normalized(Vec3f{view.x * along_, view.y * across_, view.z});
    const auto [sine, cosine] = sine_cosine(2.0f * std::numbers::pi_v<float> * random.x);
    const float height = (1.0f - random.y) * (1.0f + stretched.z) - stretched.z;
    const float radius = std::sqrt(std::clamp(1.0f - height * height, 0.0f, 1.0f));
    const Vec3f cap = Vec3f{radius * cosine, radius * sine, height} + stretched;
    return normalized(Vec3f{cap.x * along_, cap.y * across_, std::max(cap.z, 1e-6f)});
  }

 private:
  // Returns the squared ratio of the slopes to the steepness of a direction, which may point below the surface.
  [[nodiscard]] float steepness(Vec3f direction) const noexcept {
    const float x = direction.x * along_, y = direction.y * across_;
    return (x * x + y * y) / std::max(direction.z * direction.z, 1e-8f);
  }
  // Smith's function: the hidden facets per visible one.
  [[nodiscard]] float hidden(Vec3f direction) const noexcept {
    return 0.5f * (std::sqrt(1.0f + steepness(direction)) - 1.0f);
  }
  [[nodiscard]] float density_of_other(Vec3f normal) const noexcept;
  [[nodiscard]] float lit_of_other(Vec3f view, Vec3f light, Vec3f normal) const noexcept;
  [[nodiscard]] Vec3f choose_other(Point2 random) const noexcept;

  float along_, across_, product_;
  float narrower_ = 1.0f, wider_ = 1.0f;  // across by along, and the inverse
  FacetKind kind_ = FacetKind::kGgx;
};

// At equal steps from 0 to 1: by roughness, by cosine.
inline constexpr int kFacetSteps = 16;
using FacetRow = std::array<float, kFacetSteps>;
using FacetTable = std::array<FacetRow, kFacetSteps>;

[[nodiscard]] float look_up(const FacetTable& table, float cosine, float roughness) noexcept;

// The reflection of facets towards a viewer under uniform light, in tables computed once per process.
class FacetAlbedo {
 public:
  [[nodiscard]] static const FacetAlbedo& tables();

  // For perfect mirrors; less than 1, because light between facets is not followed.
  [[nodiscard]] float of_mirrors(float cosine, float roughness) const noexcept {
    return look_up(mirrors_, cosine, roughness);
  }
  [[nodiscard]] float mean_of_mirrors(float roughness) const noexcept;
  // Returns how far reflection has risen, averaged over visible facets, from that along the normal to full reflection:
  // for metals (Schlick), and for a boundary of this refractive index above 1.
  [[nodiscard]] float metal_rise(float cosine, float roughness) const noexcept {
    return look_up(metals_, cosine, roughness);
  }
  [[nodiscard]] float dielectric_rise(float cosine, float roughness, float ior) const noexcept;

 private:
  FacetAlbedo();
  void fill(int roughness, int cosine);

  FacetTable mirrors_, metals_;
  FacetRow means_;
  std::array<FacetTable, kFacetSteps> dielectrics_;  // by index
};

// The share of light that leaves facets directly: towards a viewer, and averaged over all viewers, weighted by the
// cosine.
struct FacetShare {
  float here, mean;
};
[[nodiscard]] FacetShare share_of_mirrors(float cosine, float roughness) noexcept;
// For glass, reflected and refracted together. ior: far side over viewer's side.
[[nodiscard]] FacetShare share_of_panes(float cosine, float roughness, float ior);

// Adds the light that leaves after bouncing between facets, relative to the direct light (Kulla and Conty 2017, as
// added by Turquin 2019). color: the share of light that a facet reflects, over all directions. kept: the share of
// bounced light that is not lost: 1 for Multiscatter GGX, 0 for GGX.
[[nodiscard]] Vec3f with_what_bounces(Vec3f color, const FacetShare& share, float kept) noexcept;

// Returns the normal around which facets are distributed. A smooth normal may send a mirror image below the triangle,
// where nothing is visible: it is turned towards the triangle's own normal until the image is just above, as in Cycles.
// In: both normals and the direction to the viewer, unit length, the triangle's on the viewer's side. Out: a unit
// normal.
//
// In the plane of both normals the view is r (sin p, cos p), across the triangle's normal and along it. Mirrored at a
// normal at angle a from the triangle's, it has the height r cos(2 a - p). This is `least` if a is half of p + q and r
// cos q is `least`: that normal is half-way between the triangle's and the direction at p + q.
[[nodiscard]] inline Vec3f bent_normal(Vec3f smooth, Vec3f geometric, Vec3f view) noexcept {
  const float height = dot(view, geometric), along = dot(smooth, geometric);
  const float least = std::min(0.9f * height, 0.01f);
  if (2.0f * dot(smooth, view) * along - height >= least) return smooth;
  const Vec3f across = normalized(smooth - geometric * along);
  const float side = dot(view, across), radius = std::sqrt(side * side + height * height);
  if (!(radius > 0.0f)) return smooth;
  const float sin_p = side / radius, cos_p = height / radius;
  const float cos_q = std::clamp(least / radius, -1.0f, 1.0f), sin_q = std::sqrt(1.0f - cos_q * cos_q);
  const float sine = sin_p * cos_q + cos_p * sin_q, cosine = cos_p * cos_q - sin_p * sin_q;
  return normalized(across * sine + geometric * (1.0f + cosine));
}

}  // namespace perfect_bvh
