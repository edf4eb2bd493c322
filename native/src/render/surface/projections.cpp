#include "render/surface/projections.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

Point2 around(Vec3f v) noexcept {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double size = static_cast<double>(length(v));
  const bool has_side = v.x != 0.0f || v.y != 0.0f;
  const double turned = has_side ? arc_tangent(static_cast<double>(v.x), static_cast<double>(v.y)) : 0.0;
  const double height = size > 0.0 ? arc_sine(std::clamp(static_cast<double>(v.z) / size, -1.0, 1.0)) : 0.0;
  return {has_side ? static_cast<float>((1.0 - turned / std::numbers::pi) / 2.0) : 0.0f,
          static_cast<float>(0.5 + height / (kTurn / 2.0))};
}

Point2 projected(ImageProjection projection, Vec3f v) noexcept {
  if (projection == ImageProjection::kFlat) return {v.x, v.y};
  if (projection == ImageProjection::kEquirectangular) return place_around(v);
  const Vec3f centred = v * 2.0f - Vec3f{1, 1, 1};
  const Point2 place = around(centred);
  return {place.x, projection == ImageProjection::kTube ? (centred.z + 1.0f) * 0.5f : place.y};
}

// Returns the weight of each axis' two sides for the shares `n` of a normal, which add up to 1. The shares are a
// position in a triangle: one side is visible near its corners, two are blended along its edges, and three in a smaller
// triangle in the middle.
Vec3f box_weights(Vec3f n, float blend) noexcept {
  constexpr int kPairs[3][3] = {{0, 1, 2}, {1, 2, 0}, {0, 2, 1}};  // two axes, and the third
  const float limit = 0.5f * (1.0f + blend);
  const float shares[3] = {n.x, n.y, n.z};
  float weights[3] = {0.0f, 0.0f, 0.0f};
  for (int i = 0; i < 3; ++i) {
    const float one = shares[(i + 1) % 3], other = shares[(i + 2) % 3];
    if (!(shares[i] > limit * (shares[i] + one) && shares[i] > limit * (shares[i] + other))) continue;
    weights[i] = 1.0f;
    return {weights[0], weights[1], weights[2]};
  }
  if (!(blend > 0.0f)) return {1.0f, 0.0f, 0.0f};
  for (const auto& [first, second, third] : kPairs) {
    const float both = shares[first] + shares[second];
    if (!(shares[third] < (1.0f - limit) * both)) continue;
    weights[first] = std::clamp((shares[first] / both - 0.5f * (1.0f - blend)) / blend, 0.0f, 1.0f);
    weights[second] = 1.0f - weights[first];
    return {weights[0], weights[1], weights[2]};
  }
  const auto among_three = [limit](float share) {
    return ((2.0f - limit) * share + (limit - 1.0f)) / (2.0f * limit - 1.0f);
  };
  return {among_three(n.x), among_three(n.y), among_three(n.z)};
}

}  // namespace

Rgba look_up_projected(const Texture& image, ImageProjection projection, Vec3f place) noexcept {
  const Point2 at = projected(projection, place);
  return look_up_tiled(image, at.x, at.y);
}

Rgba look_up_box(const Texture& image, Vec3f place, Vec3f normal, float blend) noexcept {
  const Vec3f sizes{std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)};
  const Vec3f weights = box_weights(sizes * (1.0f / (sizes.x + sizes.y + sizes.z)), blend);
  Rgba sum;
  const auto add = [&](float weight, bool is_turned, float u, float v) {
    if (!(weight > 0.0f)) return;
    const Rgba color = look_up(image, is_turned ? 1.0f - u : u, v);
    sum = {sum.r + weight * color.r, sum.g + weight * color.g, sum.b + weight * color.b, sum.a + weight * color.a};
  };
  add(weights.x, normal.x < 0.0f, place.y, place.z);
  add(weights.y, normal.y > 0.0f, place.x, place.z);
  add(weights.z, normal.z > 0.0f, place.y, place.x);
  return sum;
}

}  // namespace perfect_bvh
