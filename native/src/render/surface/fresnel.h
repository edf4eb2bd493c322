// How much of the light that meets a smooth boundary is reflected.
// In: the cosine between the normal and the way to the viewer; the quotient of the two refractive indices, that of the
// far side over that of the viewer's. Out: shares, 0 to 1. The rest passes.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/vec3.h"

namespace perfect_bvh {

// Seen from straight above.
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
  float cosine = 0.0f;  // of the refracted way with the normal's other side; 0 if all is reflected
};
// Of unpolarised light.
[[nodiscard]] inline Fresnel fresnel(float cosine, float ior) noexcept {
  const float square = 1.0f - (1.0f - cosine * cosine) / (ior * ior);
  if (!(square > 0.0f)) return {};
  const float refracted = std::sqrt(square);
  const float across = (cosine - ior * refracted) / (cosine + ior * refracted);
  const float along = (ior * cosine - refracted) / (ior * cosine + refracted);
  return {0.5f * (across * across + along * along), refracted};
}

// A boundary whose reflection seen from straight above is tinted; at a slant it is white.
class DielectricFresnel {
 public:
  DielectricFresnel() = default;
  DielectricFresnel(float ior, Vec3f tint) noexcept
      : ior_(ior), least_(reflectance_of(ior)), reflectance_(tint * least_) {}

  [[nodiscard]] float ior() const noexcept { return ior_; }
  [[nodiscard]] Vec3f operator()(float cosine) const noexcept { return risen(rise(fresnel(cosine, ior_).reflected)); }
  // How far a share of light has risen from that seen from straight above to all.
  [[nodiscard]] float rise(float share) const noexcept {
    return least_ < 1.0f ? std::max((share - least_) / (1.0f - least_), 0.0f) : 1.0f;
  }
  [[nodiscard]] Vec3f risen(float rise) const noexcept { return reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * rise; }

 private:
  float ior_ = 1.0f, least_ = 0.0f;
  Vec3f reflectance_{0, 0, 0};
};

// How far a metal's reflection has risen from that seen from above to all (Schlick 1994).
[[nodiscard]] inline float schlick_rise(float cosine) noexcept {
  const float rest = 1.0f - std::clamp(cosine, 0.0f, 1.0f), square = rest * rest;
  return square * square * rest;
}

// A metal that reflects `edge` of what it would by Schlick's formula at 82 degrees (Kutz et al. 2021, "F82-tint").
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
  // Of rough metal, whose facets reflect so much more than seen from straight above.
  [[nodiscard]] Vec3f risen(float rise) const noexcept { return reflectance_ + (Vec3f{1, 1, 1} - reflectance_) * rise; }

 private:
  Vec3f reflectance_{0, 0, 0}, dip_{0, 0, 0};
};

// The mean over all directions, each as likely as light is that comes evenly from everywhere, of a boundary of this
// index above 1 (the fit of d'Eon 2021).
[[nodiscard]] inline float mean_fresnel(float ior) noexcept { return (ior - 1.0f) / (4.08567f + 1.00071f * ior); }

}  // namespace perfect_bvh
