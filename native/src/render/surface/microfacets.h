// Rough surfaces as facets, each a mirror or a pane (Walter et al. 2007): the GGX distribution of their slopes, which
// of them are seen, and what they reflect in all. In: vectors in the frame of the surface's normal (z), on its side;
// alpha, the width of the slopes. Out: densities over solid angle and shares.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "math/vec3.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

class Facets {
 public:
  explicit Facets(float alpha) noexcept : alpha_(alpha), square_(alpha * alpha) {}

  // Of normals over solid angle. From the sine rather than the cosine, which has no digits left where slopes are small.
  [[nodiscard]] float density(Vec3f normal) const noexcept {
    const float sine_square = normal.x * normal.x + normal.y * normal.y;
    const float spread = normal.z * normal.z * square_ + sine_square;
    return square_ * std::numbers::inv_pi_v<float> / (spread * spread);
  }
  // Of those that a viewer sees, as `choose_seen` does.
  [[nodiscard]] float seen_density(Vec3f view, Vec3f normal) const noexcept {
    return density(normal) * seen(view.z) * std::max(dot(view, normal), 0.0f) / view.z;
  }
  // Smith's share of facets that are seen from a direction of this cosine.
  [[nodiscard]] float seen(float cosine) const noexcept { return 1.0f / (1.0f + hidden(cosine)); }
  // The share that is lit, too, of those that are seen; heights correlated (Heitz 2014).
  [[nodiscard]] float lit_of_seen(float view_cosine, float light_cosine) const noexcept {
    const float view = 1.0f + hidden(view_cosine);
    return view / (view + hidden(light_cosine));
  }
  // A facet's normal, as likely as it is seen (Heitz 2018; Dupuy and Benyoub 2023).
  [[nodiscard]] Vec3f choose_seen(Vec3f view, Point2 random) const noexcept {
    const Vec3f stretched = normalized(Vec3f{view.x * alpha_, view.y * alpha_, view.z});
    const auto [sine, cosine] = sine_cosine(2.0f * std::numbers::pi_v<float> * random.x);
    const float height = (1.0f - random.y) * (1.0f + stretched.z) - stretched.z;
    const float radius = std::sqrt(std::clamp(1.0f - height * height, 0.0f, 1.0f));
    const Vec3f cap = Vec3f{radius * cosine, radius * sine, height} + stretched;
    return normalized(Vec3f{cap.x * alpha_, cap.y * alpha_, std::max(cap.z, 1e-6f)});
  }

 private:
  [[nodiscard]] float hidden(float cosine) const noexcept {
    const float square = cosine * cosine;
    return 0.5f * (std::sqrt(1.0f + square_ * std::max(1.0f - square, 0.0f) / square) - 1.0f);
  }

  float alpha_, square_;
};

// In even steps from 0 to 1: by roughness, by cosine.
inline constexpr int kFacetSteps = 16;
using FacetRow = std::array<float, kFacetSteps>;
using FacetTable = std::array<FacetRow, kFacetSteps>;

[[nodiscard]] float look_up(const FacetTable& table, float cosine, float roughness) noexcept;

// What facets reflect of light from all around towards a viewer, in numbers worked out once a process.
class FacetAlbedo {
 public:
  [[nodiscard]] static const FacetAlbedo& tables();

  // Of perfect mirrors; less than 1, as light that a facet throws at another is not followed.
  [[nodiscard]] float of_mirrors(float cosine, float roughness) const noexcept {
    return look_up(mirrors_, cosine, roughness);
  }
  [[nodiscard]] float mean_of_mirrors(float roughness) const noexcept;
  // How far reflection has risen, in the mean over the facets that are seen, from that seen from straight above to all:
  // of metals (Schlick), and of a boundary of this refractive index above 1.
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

// The share of light that leaves facets at once: towards a viewer, and in the mean over all viewers, each as likely as
// the cosine.
struct FacetShare {
  float here, mean;
};
[[nodiscard]] FacetShare share_of_mirrors(float cosine, float roughness) noexcept;
// Of glass, reflected and refracted together. ior: of the far side over that of the viewer's.
[[nodiscard]] FacetShare share_of_panes(float cosine, float roughness, float ior);

// Light that facets throw at each other and that leaves in the end, in parts of what leaves at once (Kulla and Conty
// 2017, as Turquin 2019 adds it). color: what is left of light that meets a facet, over all directions. kept: the
// share of that light which is not lost: 1 for Multiscatter GGX, 0 for GGX.
[[nodiscard]] Vec3f with_what_bounces(Vec3f color, const FacetShare& share, float kept) noexcept;

// The normal that facets are spread around. A smooth normal may send a mirror's image below the triangle, where there
// is nothing to be seen: it is turned towards the triangle's own until the image lies just above, as Cycles has it.
// In: both normals and the way to the viewer, unit length, the triangle's on the viewer's side. Out: a unit normal.
//
// In the plane of both normals the view is r (sin p, cos p), across the triangle's normal and along it. Mirrored at a
// normal of the angle a from the triangle's it has the height r cos(2 a - p), which is `least` where a is half of p + q
// and r cos q is `least`: that normal lies half-way between the triangle's and the direction at p + q.
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
