#include "render/surface/patterns.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "math/elementary.h"
#include "render/surface/noise.h"
#include "render/surface/texture_space.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>, kTurn = 2.0f * kPi;

// Scales a point and moves it off steps of the pattern.
Vec3f off_steps(Vec3f p, float scale) noexcept {
  const auto moved = [scale](float x) { return multiply_add(x, scale, 1e-6f) * 0.999999f; };
  return {moved(p.x), moved(p.y), moved(p.z)};
}

// Returns the integer below; values out of range are clamped.
std::int32_t floor_of(float x) noexcept { return static_cast<std::int32_t>(clamped(std::floor(x), -0x1p30f, 0x1p30f)); }

// Returns a number from 0 to 1: the integer noise of libnoise (Bevins 2003), whose constants Cycles also uses.
float random_brick(std::uint32_t number) noexcept {
  constexpr std::uint32_t kMask = 0x7fffffffu;
  std::uint32_t n = (number + 1013u) & kMask;
  n ^= n >> 13;
  n = (n * (n * n * 60493u + 19990303u) + 1376312589u) & kMask;
  return 0.5f * (static_cast<float>(n) / 0x1p30f);
}

}  // namespace

float checker_factor(float scale, Vec3f p) noexcept {
  const Vec3f cell = off_steps(p * scale, 1.0f);  // unlike in waves, the product is rounded
  const auto is_odd = [](float x) { return floor_of(x) % 2 != 0; };
  return (is_odd(cell.x) == is_odd(cell.y)) == is_odd(cell.z) ? 1.0f : 0.0f;
}

BrickTexture brick_texture(const BrickSettings& settings, Vec3f point) noexcept {
  const Vec3f p = point * settings.scale;
  float width = settings.brick_width, shift = 0.0f;
  const std::int32_t row = floor_of(p.y / settings.row_height);
  if (row % std::max(settings.squash_frequency, 1) == 0) width *= settings.squash;
  if (row % std::max(settings.offset_frequency, 1) == 0) shift = width * settings.offset;
  const std::int32_t column = floor_of((p.x + shift) / width);
  const float x = p.x + shift - width * static_cast<float>(column);
  const float y = p.y - settings.row_height * static_cast<float>(row);
  const std::uint32_t number = (static_cast<std::uint32_t>(row) << 16) + (static_cast<std::uint32_t>(column) & 0xffffu);
  const float tint = clamped(random_brick(number) + settings.bias, 0.0f, 1.0f);

  const float inside = std::min({x, y, width - x, settings.row_height - y});  // distance from the brick's edge
  if (inside >= settings.mortar_size) return {0.0f, tint};
  if (settings.mortar_smooth == 0.0f) return {1.0f, tint};
  const float share = (1.0f - inside / settings.mortar_size) / settings.mortar_smooth;
  if (share >= 1.0f) return {1.0f, tint};
  return {share * share * (3.0f - 2.0f * share), tint};
}

float gradient_factor(GradientKind kind, Vec3f p) noexcept {
  const auto inside_sphere = [p] { return std::max(0.999999f - length(p), 0.0f); };
  const auto factor = [&] {
    switch (kind) {
      case GradientKind::kLinear:
        return p.x;
      case GradientKind::kQuadratic:
        return std::max(p.x, 0.0f) * std::max(p.x, 0.0f);
      case GradientKind::kEasing: {
        const float t = clamped(p.x, 0.0f, 1.0f);
        return t * t * (3.0f - 2.0f * t);
      }
      case GradientKind::kDiagonal:
        return (p.x + p.y) * 0.5f;
      case GradientKind::kSpherical:
        return inside_sphere();
      case GradientKind::kQuadraticSphere:
        return inside_sphere() * inside_sphere();
      case GradientKind::kRadial:
        return static_cast<float>(arc_tangent(static_cast<double>(p.y), static_cast<double>(p.x))) / kTurn + 0.5f;
    }
    return 0.0f;
  };
  return clamped(factor(), 0.0f, 1.0f);
}

Vec3f magic_color(const MagicSettings& settings, Vec3f point) noexcept {
  // In each step, one of x, y and z becomes a sine or cosine of their signed sum.
  struct Step {
    int target;
    bool is_sine;
    float sign;
    Vec3f signs;
  };
  constexpr std::array<Step, 10> kSteps{{{1, false, -1, {1, -1, 1}},
                                         {0, false, 1, {1, -1, -1}},
                                         {2, true, 1, {-1, -1, -1}},
                                         {0, false, -1, {-1, 1, -1}},
                                         {1, true, -1, {-1, 1, 1}},
                                         {1, false, -1, {-1, 1, 1}},
                                         {0, false, 1, {1, 1, 1}},
                                         {2, true, 1, {1, 1, -1}},
                                         {0, false, -1, {-1, -1, 1}},
                                         {1, true, -1, {1, -1, 1}}}};
  const Vec3f p{std::fmod(point.x, kTurn), std::fmod(point.y, kTurn), std::fmod(point.z, kTurn)};
  const auto angle_of = [&](float sum) { return sum * 5.0f * settings.scale; };
  Vec3f v{sine(angle_of(p.x + p.y + p.z)), cosine(angle_of(-p.x + p.y - p.z)), -cosine(angle_of(-p.x - p.y + p.z))};
  float distortion = settings.distortion;
  const float y = v.y;
  if (settings.depth > 0) v = v * distortion;
  for (int i = 0; i < std::min(settings.depth, 10); ++i) {
    const Step& step = kSteps[static_cast<std::size_t>(i)];
    float angle = v.x * step.signs.x + v.y * step.signs.y + v.z * step.signs.z;
    // Ten steps may enlarge a difference ten thousandfold: Cycles adds this product unrounded.
    if (i == 0) angle = multiply_add(-y, distortion, v.x) + v.z;
    v[step.target] = step.sign * (step.is_sine ? sine(angle) : cosine(angle)) * distortion;
  }
  if (distortion != 0.0f) {
    distortion *= 2.0f;
    v = {v.x / distortion, v.y / distortion, v.z / distortion};
  }
  return Vec3f{0.5f, 0.5f, 0.5f} - v;
}

float wave_factor(const WaveSettings& settings, Vec3f point) noexcept {
  const Vec3f p = off_steps(point, settings.scale);
  const auto axis = static_cast<int>(settings.direction);
  float phase = settings.phase;
  if (settings.kind == WaveKind::kBands) {
    phase += settings.direction == WaveDirection::kAll ? (p.x + p.y + p.z) * 10.0f : p[axis] * 20.0f;
  } else {
    Vec3f across = p;
    if (settings.direction != WaveDirection::kAll) across[axis] = 0.0f;
    phase += length(across) * 20.0f;
  }
  if (settings.distortion != 0.0f) {
    const NoiseSettings noise{
        .scale = settings.detail_scale, .detail = settings.detail, .roughness = settings.detail_roughness};
    phase += settings.distortion * (noise_factor(noise, p, 0.0f) * 2.0f - 1.0f);
  }
  if (settings.profile == WaveProfile::kSine) return 0.5f + 0.5f * sine(phase - 0.5f * kPi);
  const float turns = phase * (1.0f / kTurn);
  if (settings.profile == WaveProfile::kSaw) return turns - std::floor(turns);
  return std::abs(turns - std::floor(turns + 0.5f)) * 2.0f;
}

float white_noise_value(int dimensions, Vec3f p, float w) noexcept {
  return with_dimensions(dimensions, [&]<class N>(N) {
    return std::apply([](auto... numbers) { return random_of(numbers...); }, coordinates_of<N::value>(p, w, 1.0f));
  });
}

Vec3f white_noise_color(int dimensions, Vec3f p, float w) noexcept {
  return with_dimensions(dimensions, [&]<class N>(N) { return random_color(coordinates_of<N::value>(p, w, 1.0f)); });
}

}  // namespace perfect_bvh
