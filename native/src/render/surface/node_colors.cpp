// The functions of node_maths.h for colours.
#include <algorithm>
#include <cmath>

#include "render/surface/node_maths.h"

namespace perfect_bvh {
namespace {

// In the order of kNodeShapes.
enum class Blend : std::uint8_t {
  kMix,
  kDarken,
  kMultiply,
  kBurn,
  kLighten,
  kScreen,
  kDodge,
  kAdd,
  kOverlay,
  kSoftLight,
  kLinearLight,
  kDifference,
  kExclusion,
  kSubtract,
  kDivide,
  kHue,
  kSaturation,
  kColor,
  kValue,
};
enum class Conversion : std::uint8_t { kRgbToHsv, kHsvToRgb, kRgbToHsl, kHslToRgb };

Vec3f even(float value) noexcept { return {value, value, value}; }

struct Spread {
  float most, least;
};
Spread spread_of(Vec3f c) noexcept { return {std::max({c.x, c.y, c.z}), std::min({c.x, c.y, c.z})}; }

// Returns 0 to 1; 0 for grey.
float hue_of(Vec3f c, Spread spread) noexcept {
  const float delta = spread.most - spread.least;
  if (delta == 0.0f) return 0.0f;
  const float sector = c.x == spread.most   ? (c.y - c.z) / delta
                       : c.y == spread.most ? 2.0f + (c.z - c.x) / delta
                                            : 4.0f + (c.x - c.y) / delta;
  const float hue = sector / 6.0f;
  return hue < 0.0f ? hue + 1.0f : hue;
}

// Returns the value of each channel at a hue, 0 to 1.
Vec3f fullness(float hue) noexcept {
  const auto fall = [hue](float place) { return std::clamp(std::abs(hue * 6.0f - place) - 1.0f, 0.0f, 1.0f); };
  return {fall(3.0f), 1.0f - fall(2.0f), 1.0f - fall(4.0f)};
}

Vec3f to_hsv(Vec3f c) noexcept {
  const Spread spread = spread_of(c);
  const float delta = spread.most - spread.least;
  const float saturation = spread.most != 0.0f ? delta / spread.most : 0.0f;
  return {saturation != 0.0f ? hue_of(c, spread) : 0.0f, saturation, spread.most};
}

Vec3f from_hsv(Vec3f hsv) noexcept {
  if (hsv.y == 0.0f) return even(hsv.z);
  // Hues beyond the range belong to the last sector, as in Blender.
  const float sector = hsv.x * 6.0f;
  const bool is_beyond = sector < 0.0f || sector > 6.0f;
  const Vec3f full = is_beyond ? Vec3f{1.0f, 0.0f, 1.0f - (sector - std::floor(sector))} : fullness(hsv.x);
  return ((full - Vec3f{1, 1, 1}) * hsv.y + Vec3f{1, 1, 1}) * hsv.z;
}

Vec3f to_hsl(Vec3f c) noexcept {
  const Spread spread = spread_of(c);
  const float delta = spread.most - spread.least;
  const float light = std::min((spread.most + spread.least) * 0.5f, 1.0f);
  if (delta == 0.0f) return {0, 0, light};
  const float whole = light > 0.5f ? 2.0f - spread.most - spread.least : spread.most + spread.least;
  return {hue_of(c, spread), delta / whole, light};
}

Vec3f from_hsl(Vec3f hsl) noexcept {
  const float chroma = (1.0f - std::abs(2.0f * hsl.z - 1.0f)) * hsl.y;
  return (fullness(hsl.x) - Vec3f{0.5f, 0.5f, 0.5f}) * chroma + even(hsl.z);
}

float dodged(float share, float a, float b) noexcept {
  if (a == 0.0f) return a;
  const float left = 1.0f - share * b;
  return left <= 0.0f ? 1.0f : std::min(a / left, 1.0f);
}

float burned(float share, float a, float b) noexcept {
  const float left = 1.0f - share + share * b;
  return left <= 0.0f ? 0.0f : std::clamp(1.0f - (1.0f - a) / left, 0.0f, 1.0f);
}

float overlaid(float share, float a, float b) noexcept {
  const float rest = 1.0f - share;
  return a < 0.5f ? a * (rest + 2.0f * share * b) : 1.0f - (rest + 2.0f * share * (1.0f - b)) * (1.0f - a);
}

float softly_lit(float share, float a, float b) noexcept {
  const float screen = 1.0f - (1.0f - b) * (1.0f - a);
  return (1.0f - share) * a + share * ((1.0f - a) * b * a + a * screen);
}

float blended(Blend mode, float share, float a, float b) noexcept {
  const auto by_share = [=](float other) { return a + (other - a) * share; };
  switch (mode) {
    case Blend::kDarken:
      return by_share(std::min(a, b));
    case Blend::kMultiply:
      return by_share(a * b);
    case Blend::kBurn:
      return burned(share, a, b);
    case Blend::kLighten:
      return by_share(std::max(a, b));
    case Blend::kScreen:
      return 1.0f - (1.0f - share + share * (1.0f - b)) * (1.0f - a);
    case Blend::kDodge:
      return dodged(share, a, b);
    case Blend::kAdd:
      return by_share(a + b);
    case Blend::kOverlay:
      return overlaid(share, a, b);
    case Blend::kSoftLight:
      return softly_lit(share, a, b);
    case Blend::kLinearLight:
      return a + share * (2.0f * b - 1.0f);
    case Blend::kDifference:
      return by_share(std::abs(a - b));
    case Blend::kExclusion:
      return std::max(by_share(a + b - 2.0f * a * b), 0.0f);
    case Blend::kSubtract:
      return by_share(a - b);
    case Blend::kDivide:
      return b != 0.0f ? (1.0f - share) * a + share * a / b : a;
    default:
      return by_share(b);  // kMix
  }
}

// For modes that take hue, saturation or value from the second colour.
Vec3f tuned(Blend mode, float share, Vec3f a, Vec3f b) noexcept {
  Vec3f hsv = to_hsv(a);
  const Vec3f other = to_hsv(b);
  const bool has_hue = other.y != 0.0f;
  if (mode == Blend::kValue) return from_hsv({hsv.x, hsv.y, (1.0f - share) * hsv.z + share * other.z});
  if (mode == Blend::kSaturation) {
    return hsv.y == 0.0f ? a : from_hsv({hsv.x, (1.0f - share) * hsv.y + share * other.y, hsv.z});
  }
  if (!has_hue) return a;
  hsv.x = other.x;
  if (mode == Blend::kColor) hsv.y = other.y;
  return a + (from_hsv(hsv) - a) * share;
}

}  // namespace

float luminance(Vec3f color) noexcept { return 0.2126390f * color.x + 0.7151687f * color.y + 0.0721923f * color.z; }

Vec3f node_mix(std::uint8_t mode, Vec3f share, Vec3f a, Vec3f b) noexcept {
  const auto blend = static_cast<Blend>(mode);
  if (blend >= Blend::kHue) return tuned(blend, share.x, a, b);
  return {blended(blend, share.x, a.x, b.x), blended(blend, share.y, a.y, b.y), blended(blend, share.z, a.z, b.z)};
}

Vec3f node_convert(std::uint8_t mode, Vec3f color) noexcept {
  switch (static_cast<Conversion>(mode)) {
    case Conversion::kRgbToHsv:
      return to_hsv(color);
    case Conversion::kHsvToRgb:
      return from_hsv(color);
    case Conversion::kRgbToHsl:
      return to_hsl(color);
    default:
      return from_hsl(color);  // kHslToRgb
  }
}

Vec3f node_hue_saturation(float hue, float saturation, float value, float share, Vec3f color) noexcept {
  Vec3f hsv = to_hsv(color);
  hsv.x = std::fmod(hsv.x + hue + 0.5f, 1.0f);
  hsv.y = std::clamp(hsv.y * saturation, 0.0f, 1.0f);
  hsv.z *= value;
  const Vec3f changed = from_hsv(hsv) * share + color * (1.0f - share);
  return max(changed, Vec3f{0, 0, 0});
}

}  // namespace perfect_bvh
