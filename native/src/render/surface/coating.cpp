#include "render/surface/coating.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastCosine = 1e-4f;

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

Vec3f local(const Frame& frame, Vec3f world) noexcept {
  return {dot(world, frame.x), dot(world, frame.y), dot(world, frame.z)};
}

Vec3f coat_normal_of(const Material& material, const Coating::Place& place) noexcept {
  const Vec3f normal = material.coat_normal == Vec3f{0, 0, 0} ? place.normal : material.coat_normal;
  return bent_normal(normal, place.geometric_normal, place.view);
}

Vec3f fiber_normal_of(const Material& material, const Finish& finish, const Coating::Place& place) noexcept {
  if (material.coat_normal == Vec3f{0, 0, 0} || !(finish.coat > 0.0f)) return place.normal;
  return normalized(place.normal + (material.coat_normal - place.normal) * std::min(finish.coat, 1.0f));
}

// A linear spline in cosine and roughness, fitted to renders of Cycles (tests/blender/fit_sheen.py): the square root of
// the albedo's negative logarithm, the scale and the shear. From a roughness of .25 on, a sphere reflects as much light
// as in Cycles to 2 %; below that fibers are hardly visible.
constexpr std::array kCosines{0.0f, 0.1f, 0.2f, 0.35f, 0.5f, 0.7f, 1.0f};
constexpr std::array kAlbedoRoughnesses{0.1f, 0.15f, 0.2f, 0.26f, 0.33f, 0.42f, 0.54f, 0.68f, 0.84f, 1.0f};
constexpr std::array kShapeRoughnesses{0.1f, 0.2f, 0.35f, 0.6f, 1.0f};
using Row = std::array<float, kCosines.size()>;
constexpr Row kDepths[]{
    {1.273f, 1.854f, 2.53f, 3.086f, 3.227f, 3.455f, 3.392f},  {0.783f, 1.288f, 1.935f, 2.634f, 2.885f, 3.155f, 3.341f},
    {0.755f, 1.111f, 1.578f, 2.161f, 2.543f, 2.848f, 3.105f}, {0.693f, 0.97f, 1.306f, 1.776f, 2.159f, 2.514f, 2.839f},
    {0.664f, 0.887f, 1.133f, 1.498f, 1.829f, 2.19f, 2.582f},  {0.643f, 0.818f, 1.0f, 1.276f, 1.537f, 1.85f, 2.244f},
    {0.635f, 0.758f, 0.892f, 1.095f, 1.291f, 1.535f, 1.877f}, {0.616f, 0.707f, 0.805f, 0.954f, 1.1f, 1.281f, 1.536f},
    {0.584f, 0.653f, 0.727f, 0.838f, 0.946f, 1.077f, 1.248f}, {0.543f, 0.599f, 0.662f, 0.752f, 0.834f, 0.928f, 1.035f},
};
constexpr Row kScales[]{
    {0.065f, 0.048f, 0.028f, 0.064f, 0.122f, 0.229f, 0.404f}, {0.062f, 0.123f, 0.15f, 0.173f, 0.2f, 0.244f, 0.376f},
    {0.127f, 0.211f, 0.268f, 0.308f, 0.327f, 0.35f, 0.421f},  {0.332f, 0.419f, 0.483f, 0.544f, 0.582f, 0.619f, 0.668f},
    {0.747f, 0.808f, 0.842f, 0.865f, 0.877f, 0.884f, 0.888f},
};
constexpr Row kShears[]{
    {-0.416f, 0.087f, -0.055f, 0.002f, -0.021f, -0.017f, -0.005f},
    {-0.16f, 0.012f, -0.009f, -0.021f, -0.038f, -0.067f, -0.041f},
    {-0.238f, -0.099f, -0.041f, -0.01f, -0.007f, -0.017f, -0.027f},
    {-0.194f, -0.173f, -0.147f, -0.114f, -0.091f, -0.074f, -0.025f},
    {-0.017f, -0.014f, -0.016f, -0.019f, -0.018f, -0.014f, -0.002f},
};

struct Knot {
  std::size_t low;
  float part;
};
Knot knot_at(std::span<const float> knots, float at) noexcept {
  std::size_t low = 0;
  while (low + 2 < knots.size() && knots[low + 1] <= at) ++low;
  return {low, std::clamp((at - knots[low]) / (knots[low + 1] - knots[low]), 0.0f, 1.0f)};
}
float between(float low, float high, float part) noexcept { return low + (high - low) * part; }

float look_up(std::span<const Row> table, Knot cosine, Knot roughness) noexcept {
  const auto across = [&](const Row& row) { return between(row[cosine.low], row[cosine.low + 1], cosine.part); };
  return between(across(table[roughness.low]), across(table[roughness.low + 1]), roughness.part);
}

}  // namespace

SheenLobe sheen_lobe(float cosine, float roughness) noexcept {
  const Knot column = knot_at(kCosines, cosine), shape = knot_at(kShapeRoughnesses, roughness);
  float depth = look_up(kDepths, column, knot_at(kAlbedoRoughnesses, roughness));
  // Fibers smoother than the table's first row reflect almost nothing.
  const float smoother = kAlbedoRoughnesses[0] / std::clamp(roughness, 1e-3f, kAlbedoRoughnesses[0]);
  if (smoother > 1.0f) depth *= power(smoother, 0.75f);
  const auto albedo = static_cast<float>(exponential(-static_cast<double>(depth * depth)));
  return {look_up(kScales, column, shape), look_up(kShears, column, shape), albedo};
}

Coating::Coating(const Material& material, const Finish& finish, const Place& place, float least_alpha,
                 bool has_coat) noexcept
    : fibers_(framed(fiber_normal_of(material, finish, place), place.view)),
      layer_(coat_normal_of(material, place)),
      view_(local(layer_, place.view)),
      facets_(std::max(finish.coat_roughness * finish.coat_roughness, least_alpha)),
      ior_(std::max(finish.coat_ior, 1.0f)) {
  view_.z = std::max(view_.z, kLeastCosine);
  if (largest(finish.sheen) > 0.0f) add_sheen(finish, place.view);
  if (!(finish.coat > 0.0f)) return;
  if (has_coat) add_coat(finish);
  if (finish.coat_tint == Vec3f{1, 1, 1}) return;
  // Light crosses the coat along the refracted direction to the viewer.
  const float sine_square = (1.0f - view_.z * view_.z) / (ior_ * ior_);
  const float depth = 1.0f / std::sqrt(std::max(1.0f - sine_square, kLeastCosine));
  const auto left = [&](float tint) { return 1.0f + (power(std::max(tint, 0.0f), depth) - 1.0f) * finish.coat; };
  below_ = below_ * Vec3f{left(finish.coat_tint.x), left(finish.coat_tint.y), left(finish.coat_tint.z)};
}

void Coating::add_sheen(const Finish& finish, Vec3f view) noexcept {
  const SheenLobe lobe = sheen_lobe(dot(fibers_.z, view), finish.sheen_roughness);
  scale_ = lobe.scale, shear_ = lobe.shear, sheen_ = finish.sheen * lobe.albedo;
  below_ = below_ * std::max(1.0f - finish.sheen_cover * largest(sheen_), 0.0f);
}

void Coating::add_coat(const Finish& finish) noexcept {
  coat_ = below_ * finish.coat;
  const float mirrored = fresnel(view_.z, ior_).reflected;
  coat_albedo_ = coat_ * mirrored;
  below_ = below_ * std::max(1.0f - finish.coat * mirrored, 0.0f);
}

Coating::Value Coating::sheen(Vec3f direction) const noexcept {
  const Vec3f out = local(fibers_, direction);
  if (!(out.z > 0.0f)) return {};
  const float x = scale_ * out.x + shear_ * out.z, y = scale_ * out.y, root = scale_ / (x * x + y * y + out.z * out.z);
  const float density = out.z * root * root / kPi;
  return {sheen_ * density, density};
}

Vec3f Coating::choose_sheen(Point2 random) const noexcept {
  const Point2 flat = uniform_disk(random);
  const float height = std::sqrt(std::max(0.0f, 1.0f - flat.x * flat.x - flat.y * flat.y));
  const Vec3f out{(flat.x - height * shear_) / scale_, flat.y / scale_, height};
  return fibers_.world(normalized(out));
}

Coating::Value Coating::coat(Vec3f direction) const noexcept {
  const Vec3f out = local(layer_, direction);
  if (!(out.z > 0.0f) || has_smooth_coat()) return {};
  const Vec3f half = normalized(view_ + out);
  const float slant = dot(view_, half);
  if (!(slant > 0.0f)) return {};
  const float density = facets_.seen_density(view_, half) / (4.0f * slant);
  return {coat_ * (fresnel(slant, ior_).reflected * density * facets_.lit_of_seen(view_, out, half)), density};
}

Coating::Mirrored Coating::choose_coat(Point2 random) const noexcept {
  const Vec3f facet = has_smooth_coat() ? Vec3f{0, 0, 1} : facets_.choose_seen(view_, random);
  const float slant = std::max(dot(view_, facet), 0.0f);
  return {layer_.world(facet * (2.0f * slant) - view_), coat_ * fresnel(slant, ior_).reflected};
}

}  // namespace perfect_bvh
