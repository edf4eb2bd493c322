#include "render/surface/specular.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/sampling/directions.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastWidth = 0.02f;  // of a lobe: narrower highlights are single bright pixels
constexpr float kLeastCosine = 1e-3f;
constexpr float kRoughestMirror = 0.4f, kLeastReflectance = 0.15f;

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

float width_of(const Specular& specular) noexcept {
  return std::max(specular.roughness * specular.roughness, kLeastWidth);
}

// Smith's share of microfacets that are seen from a direction of this cosine.
float seen_share(float cosine, float square) noexcept {
  return 2.0f * cosine / (cosine + std::sqrt(square + (1.0f - square) * cosine * cosine));
}

// Over solid angle, of directions that visible facets mirror: those of the GGX distribution whose normal has a cosine
// of `upwards` with the surface's, seen by a viewer at the other cosine.
float density_about(float upwards, float towards_viewer, float square) noexcept {
  const float spread = upwards * upwards * (square - 1.0f) + 1.0f;
  const float facets = square / (kPi * spread * spread);
  return facets * seen_share(towards_viewer, square) / (4.0f * towards_viewer);
}

// What the facets of a rough metal throw at each other reaches the viewer in the end (Turquin 2019). The fit is to the
// direction in which least is missing, so that nothing shines brighter than what it mirrors.
Vec3f with_what_bounces(const Specular& specular, float width) noexcept {
  const float missing = 0.45f * width * std::min(3.0f * width, 1.0f);
  return Vec3f{1, 1, 1} + specular.reflectance * (missing / (1.0f - missing));
}

}  // namespace

bool Specular::mirrors() const noexcept {
  return shines() && (roughness < kRoughestMirror || largest(reflectance) > kLeastReflectance);
}

Vec3f reflected_share(const Specular& specular, float cosine) noexcept {
  const float rest = 1.0f - std::clamp(cosine, 0.0f, 1.0f), square = rest * rest;
  // What hardly reflects from above is no mirror at a slant either.
  const float rise = square * square * rest * std::min(25.0f * largest(specular.reflectance), 1.0f);
  return specular.reflectance + (Vec3f{1, 1, 1} - specular.reflectance) * rise;
}

float unreflected_share(const Specular& specular, float cosine) noexcept {
  const float least = largest(specular.reflectance), most = std::max(least, 1.0f - specular.roughness);
  const float part = (largest(reflected_share(specular, cosine)) - least) / std::max(1.0f - least, 1e-6f);
  return 1.0f - (least + (most - least) * part);
}

Highlight highlight(const Specular& specular, Vec3f normal, Vec3f to_light) noexcept {
  const Vec3f half = normalized(specular.view + to_light);
  const float width = width_of(specular), square = width * width;
  const float towards_light = std::max(dot(normal, to_light), kLeastCosine);
  const float density = density_about(dot(normal, half), std::max(dot(normal, specular.view), kLeastCosine), square);
  const Vec3f share = reflected_share(specular, dot(specular.view, half)) * with_what_bounces(specular, width);
  return {share * (kPi * density * seen_share(towards_light, square) / towards_light), density};
}

Mirrored mirrored(const Specular& specular, Vec3f normal, Point2 random) noexcept {
  const Frame frame(normal);
  const float width = width_of(specular);
  const Vec3f view{dot(specular.view, frame.x), dot(specular.view, frame.y),
                   std::max(dot(specular.view, frame.z), kLeastCosine)};
  // Stretched so that the facets are a hemisphere, of which the view lights a cap.
  const Vec3f stretched = normalized(Vec3f{view.x * width, view.y * width, view.z});
  const float angle = 2.0f * kPi * random.x, height = (1.0f - random.y) * (1.0f + stretched.z) - stretched.z;
  const float radius = std::sqrt(std::clamp(1.0f - height * height, 0.0f, 1.0f));
  const Vec3f cap = Vec3f{radius * std::cos(angle), radius * std::sin(angle), height} + stretched;
  const Vec3f facet = normalized(Vec3f{cap.x * width, cap.y * width, std::max(cap.z, 1e-6f)});
  const float cosine = dot(view, facet);
  const Vec3f direction = facet * (2.0f * cosine) - view;
  if (!(direction.z > 0.0f)) return {};
  const Vec3f share = reflected_share(specular, cosine) * with_what_bounces(specular, width);
  return {frame.world(direction), share * seen_share(direction.z, width * width),
          density_about(facet.z, view.z, width * width)};
}

}  // namespace perfect_bvh
