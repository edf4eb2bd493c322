#include "render/surface/coating.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastCosine = 1e-4f;
constexpr float kLeastScale = 0.01f;  // of fibers' light

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

// Quadratic B-splines in the square roots of cosine and roughness, fitted to renders of Cycles
// (tests/blender/fit_sheen.py): the square root of the albedo's negative logarithm, the scale and the shear. Rows begin
// at a roughness of .09; below that fibers are hardly visible.
constexpr std::size_t kKnots = 8;
constexpr float kLeastRoot = 0.3f;
using Table = std::array<std::array<float, kKnots>, kKnots>;
constexpr Table kDepths{{
    {1.464f, 0.866f, 1.830f, 3.211f, 3.860f, 2.184f, 6.760f, -0.370f},
    {0.515f, 0.671f, 1.026f, 1.879f, 2.831f, 3.166f, 3.289f, 3.589f},
    {0.734f, 0.574f, 0.840f, 1.260f, 1.898f, 2.504f, 2.877f, 3.076f},
    {0.707f, 0.581f, 0.749f, 1.008f, 1.387f, 1.850f, 2.306f, 2.667f},
    {0.673f, 0.594f, 0.700f, 0.866f, 1.115f, 1.428f, 1.782f, 2.181f},
    {0.645f, 0.593f, 0.662f, 0.770f, 0.935f, 1.150f, 1.392f, 1.671f},
    {0.608f, 0.560f, 0.608f, 0.682f, 0.797f, 0.943f, 1.097f, 1.248f},
    {0.508f, 0.505f, 0.535f, 0.600f, 0.689f, 0.790f, 0.869f, 0.930f},
}};
constexpr Table kScales{{
    {-0.004f, 0.020f, 0.009f, 0.057f, 0.202f, 0.188f, 1.033f, 1.262f},
    {0.038f, 0.041f, 0.060f, 0.041f, 0.056f, 0.141f, 0.248f, 0.553f},
    {0.119f, 0.059f, 0.108f, 0.170f, 0.188f, 0.221f, 0.278f, 0.460f},
    {0.137f, 0.115f, 0.174f, 0.262f, 0.314f, 0.341f, 0.391f, 0.515f},
    {0.229f, 0.222f, 0.282f, 0.366f, 0.439f, 0.481f, 0.524f, 0.598f},
    {0.423f, 0.374f, 0.452f, 0.536f, 0.603f, 0.654f, 0.695f, 0.729f},
    {0.658f, 0.620f, 0.684f, 0.750f, 0.790f, 0.812f, 0.828f, 0.844f},
    {0.843f, 0.821f, 0.851f, 0.884f, 0.908f, 0.923f, 0.926f, 0.918f},
}};
constexpr Table kShears{{
    {0.154f, 0.059f, -0.024f, 0.036f, -0.093f, -0.013f, 0.123f, -0.179f},
    {-0.341f, -0.096f, 0.020f, -0.030f, 0.029f, -0.060f, -0.034f, -0.017f},
    {-0.022f, -0.217f, -0.034f, 0.012f, -0.038f, -0.013f, -0.069f, 0.048f},
    {-0.098f, -0.189f, -0.159f, -0.033f, -0.007f, -0.032f, -0.047f, -0.008f},
    {-0.165f, -0.178f, -0.175f, -0.135f, -0.068f, -0.038f, -0.038f, 0.005f},
    {-0.142f, -0.152f, -0.158f, -0.135f, -0.113f, -0.081f, -0.051f, 0.025f},
    {-0.083f, -0.077f, -0.077f, -0.073f, -0.063f, -0.055f, -0.041f, 0.025f},
    {0.089f, 0.080f, 0.079f, 0.075f, 0.062f, 0.055f, 0.041f, -0.025f},
}};

// The weights of three knots from one on.
struct Knots {
  std::size_t first;
  std::array<float, 3> weights;
};
Knots knots_at(float place) noexcept {
  const float along = std::clamp(place, 0.0f, 1.0f) * (kKnots - 2);
  const std::size_t first = std::min(static_cast<std::size_t>(along), kKnots - 3);
  const float part = along - static_cast<float>(first), rest = 1.0f - part;
  return {first, {0.5f * rest * rest, 0.5f + part * rest, 0.5f * part * part}};
}

float look_up(const Table& table, const Knots& row, const Knots& column) noexcept {
  float found = 0.0f;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      found += row.weights[i] * column.weights[j] * table[row.first + i][column.first + j];
  return found;
}

}  // namespace

SheenLobe sheen_lobe(float cosine, float roughness) noexcept {
  const float root = std::sqrt(std::clamp(roughness, 1e-3f, 1.0f));
  const Knots row = knots_at((root - kLeastRoot) / (1.0f - kLeastRoot));
  const Knots column = knots_at(std::sqrt(std::max(cosine, 0.0f)));
  float depth = look_up(kDepths, row, column);
  if (root < kLeastRoot) depth *= power(kLeastRoot / root, 1.5f);
  const auto albedo = static_cast<float>(exponential(-static_cast<double>(depth * depth)));
  return {std::max(look_up(kScales, row, column), kLeastScale), look_up(kShears, row, column), albedo};
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
