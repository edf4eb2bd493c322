#include "render/surface/node_maths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

// In the order of kNodeShapes.
enum class Math : std::uint8_t {
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kMultiplyAdd,
  kPower,
  kLogarithm,
  kSqrt,
  kInverseSqrt,
  kAbsolute,
  kExponent,
  kMinimum,
  kMaximum,
  kLessThan,
  kGreaterThan,
  kSign,
  kCompare,
  kSmoothMin,
  kSmoothMax,
  kRound,
  kFloor,
  kCeil,
  kTrunc,
  kFract,
  kModulo,
  kFlooredModulo,
  kWrap,
  kSnap,
  kPingpong,
  kSine,
  kCosine,
  kTangent,
  kArcsine,
  kArccosine,
  kArctangent,
  kArctan2,
  kSinh,
  kCosh,
  kTanh,
  kRadians,
  kDegrees,
  kClamp,
};
enum class VectorMath : std::uint8_t {
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kMultiplyAdd,
  kCross,
  kProject,
  kReflect,
  kRefract,
  kFaceforward,
  kDot,
  kDistance,
  kLength,
  kScale,
  kNormalize,
  kAbsolute,
  kPower,
  kSign,
  kMinimum,
  kMaximum,
  kFloor,
  kCeil,
  kFraction,
  kModulo,
  kWrap,
  kSnap,
  kSine,
  kCosine,
  kTangent,
};
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
enum class Range : std::uint8_t { kLinear, kStepped, kSmoothstep, kSmootherstep };
enum class Mapping : std::uint8_t { kPoint, kTexture, kVector, kNormal };
enum class Rotation : std::uint8_t { kAxisAngle, kX, kY, kZ, kEuler };

// A function of doubles, in floats.
template <class Function, class... Floats>
float by_double(Function function, Floats... values) noexcept {
  return static_cast<float>(function(static_cast<double>(values)...));
}

float divided(float a, float b) noexcept { return b != 0.0f ? a / b : 0.0f; }

// Negative bases have powers by integers.
float power_of(float a, float b) noexcept {
  if (b == 0.0f) return 1.0f;
  if (a >= 0.0f) return power(a, b);
  if (b != std::trunc(b)) return 0.0f;
  const float size = power(-a, b);
  return std::fmod(b, 2.0f) != 0.0f ? -size : size;
}

float modulo(float a, float b) noexcept { return b != 0.0f ? std::fmod(a, b) : 0.0f; }

float wrapped(float value, float high, float low) noexcept {
  const float range = high - low;
  return range != 0.0f ? value - range * std::floor((value - low) / range) : low;
}

float smooth_min(float a, float b, float width) noexcept {
  if (width == 0.0f) return std::min(a, b);
  const float h = std::max(width - std::abs(a - b), 0.0f) / width;
  return std::min(a, b) - h * h * h * width * (1.0f / 6.0f);
}

float ping_pong(float a, float b) noexcept {
  if (b == 0.0f) return 0.0f;
  const float turns = (a - b) / (b * 2.0f);
  return std::abs((turns - std::floor(turns)) * b * 2.0f - b);
}

float logarithm_by(float a, float base) noexcept {
  if (!(a > 0.0f && base > 0.0f)) return 0.0f;
  return divided(by_double(logarithm, a), by_double(logarithm, base));
}

float sign_of(float a) noexcept { return a < 0.0f ? -1.0f : a > 0.0f ? 1.0f : 0.0f; }

float tangent_of(float a) noexcept {
  const SineCosine<float> both = sine_cosine(a);
  return divided(both.sine, both.cosine);
}

float arc_cosine_of(float a) noexcept {
  return by_double([](double x) { return std::numbers::pi / 2.0 - arc_sine(x); }, std::clamp(a, -1.0f, 1.0f));
}

float hyperbolic(float a, double sign) noexcept {
  const double grown = exponential(static_cast<double>(a)), shrunk = exponential(-static_cast<double>(a));
  return static_cast<float>(0.5 * (grown + sign * shrunk));
}

float hyperbolic_tangent(float a) noexcept {
  if (std::abs(a) > 20.0f) return sign_of(a);
  const double squared = exponential(2.0 * static_cast<double>(a));
  return static_cast<float>((squared - 1.0) / (squared + 1.0));
}

float trigonometric(Math mode, float a, float b) noexcept {
  switch (mode) {
    case Math::kSine:
      return sine(a);
    case Math::kCosine:
      return cosine(a);
    case Math::kTangent:
      return tangent_of(a);
    case Math::kArcsine:
      return by_double(arc_sine, std::clamp(a, -1.0f, 1.0f));
    case Math::kArccosine:
      return arc_cosine_of(a);
    case Math::kArctangent:
      return by_double(arc_tangent, a, 1.0f);
    case Math::kArctan2:
      return by_double(arc_tangent, a, b);
    case Math::kSinh:
      return hyperbolic(a, -1.0);
    case Math::kCosh:
      return hyperbolic(a, 1.0);
    case Math::kTanh:
      return hyperbolic_tangent(a);
    case Math::kRadians:
      return a * (std::numbers::pi_v<float> / 180.0f);
    default:
      return a * (180.0f / std::numbers::pi_v<float>);  // kDegrees
  }
}

// By component.
template <class Function, class... Vectors>
Vec3f each(Function function, Vectors... v) noexcept {
  return {function(v.x...), function(v.y...), function(v.z...)};
}

Vec3f unit(Vec3f v) noexcept {
  const float size = length(v);
  return size > 0.0f ? v * (1.0f / size) : v;
}

Vec3f even(float value) noexcept { return {value, value, value}; }

Vec3f refracted(Vec3f incident, Vec3f normal, float eta) noexcept {
  const float along = dot(normal, incident), k = 1.0f - eta * eta * (1.0f - along * along);
  return k < 0.0f ? Vec3f{0, 0, 0} : incident * eta - normal * (eta * along + std::sqrt(k));
}

Vec3f projected(Vec3f a, Vec3f b) noexcept {
  const float size = dot(b, b);
  return size != 0.0f ? b * (dot(a, b) / size) : Vec3f{0, 0, 0};
}

// Colours
// ---------------------------------------------------------------------------------------------------------------

struct Spread {
  float most, least;
};
Spread spread_of(Vec3f c) noexcept { return {std::max({c.x, c.y, c.z}), std::min({c.x, c.y, c.z})}; }

// 0 to 1; 0 of what is grey.
float hue_of(Vec3f c, Spread spread) noexcept {
  const float delta = spread.most - spread.least;
  if (delta == 0.0f) return 0.0f;
  const float sector = c.x == spread.most   ? (c.y - c.z) / delta
                       : c.y == spread.most ? 2.0f + (c.z - c.x) / delta
                                            : 4.0f + (c.x - c.y) / delta;
  const float hue = sector / 6.0f;
  return hue < 0.0f ? hue + 1.0f : hue;
}

// How full each channel is at a hue.
Vec3f fullness(float hue) noexcept {
  hue = hue - std::floor(hue);
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
  const Vec3f full = fullness(hsv.x);
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

// What takes something of the second colour's hue, saturation and value.
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

// Rotations
// -------------------------------------------------------------------------------------------------------------

struct Turn {
  Vec3f x, y, z;  // columns
  [[nodiscard]] Vec3f of(Vec3f v) const noexcept { return x * v.x + y * v.y + z * v.z; }
  [[nodiscard]] Vec3f back(Vec3f v) const noexcept { return {dot(x, v), dot(y, v), dot(z, v)}; }
};

// About x, then y, then z.
Turn turn_of(Vec3f angles) noexcept {
  const auto [sx, cx] = sine_cosine(angles.x);
  const auto [sy, cy] = sine_cosine(angles.y);
  const auto [sz, cz] = sine_cosine(angles.z);
  return {{cy * cz, cy * sz, -sy},
          {sy * sx * cz - cx * sz, sy * sx * sz + cx * cz, cy * sx},
          {sy * cx * cz + sx * sz, sy * cx * sz - sx * cz, cy * cx}};
}

Vec3f turned_about(Vec3f v, Vec3f axis, float angle) noexcept {
  const auto [s, c] = sine_cosine(angle);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1.0f - c));
}

}  // namespace

float luminance(Vec3f color) noexcept { return 0.2126390f * color.x + 0.7151687f * color.y + 0.0721923f * color.z; }

float node_math(std::uint8_t mode, float a, float b, float c) noexcept {
  switch (static_cast<Math>(mode)) {
    case Math::kAdd:
      return a + b;
    case Math::kSubtract:
      return a - b;
    case Math::kMultiply:
      return a * b;
    case Math::kDivide:
      return divided(a, b);
    case Math::kMultiplyAdd:
      return a * b + c;
    case Math::kPower:
      return power_of(a, b);
    case Math::kLogarithm:
      return logarithm_by(a, b);
    case Math::kSqrt:
      return std::sqrt(std::max(a, 0.0f));
    case Math::kInverseSqrt:
      return a > 0.0f ? 1.0f / std::sqrt(a) : 0.0f;
    case Math::kAbsolute:
      return std::abs(a);
    case Math::kExponent:
      return by_double(exponential, a);
    case Math::kMinimum:
      return std::min(a, b);
    case Math::kMaximum:
      return std::max(a, b);
    case Math::kLessThan:
      return a < b ? 1.0f : 0.0f;
    case Math::kGreaterThan:
      return a > b ? 1.0f : 0.0f;
    case Math::kSign:
      return sign_of(a);
    case Math::kCompare:
      return a == b || std::abs(a - b) <= std::max(c, std::numeric_limits<float>::epsilon()) ? 1.0f : 0.0f;
    case Math::kSmoothMin:
      return smooth_min(a, b, c);
    case Math::kSmoothMax:
      return -smooth_min(-a, -b, c);
    case Math::kRound:
      return std::floor(a + 0.5f);
    case Math::kFloor:
      return std::floor(a);
    case Math::kCeil:
      return std::ceil(a);
    case Math::kTrunc:
      return std::trunc(a);
    case Math::kFract:
      return a - std::floor(a);
    case Math::kModulo:
      return modulo(a, b);
    case Math::kFlooredModulo:
      return b != 0.0f ? a - std::floor(a / b) * b : 0.0f;
    case Math::kWrap:
      return wrapped(a, b, c);
    case Math::kSnap:
      return std::floor(divided(a, b)) * b;
    case Math::kPingpong:
      return ping_pong(a, b);
    case Math::kClamp:
      return std::min(std::max(a, b), c);
    default:
      return trigonometric(static_cast<Math>(mode), a, b);
  }
}

Vec3f node_vector_math(std::uint8_t mode, Vec3f a, Vec3f b, Vec3f c, float scale) noexcept {
  switch (static_cast<VectorMath>(mode)) {
    case VectorMath::kAdd:
      return a + b;
    case VectorMath::kSubtract:
      return a - b;
    case VectorMath::kMultiply:
      return a * b;
    case VectorMath::kDivide:
      return each(divided, a, b);
    case VectorMath::kMultiplyAdd:
      return a * b + c;
    case VectorMath::kCross:
      return cross(a, b);
    case VectorMath::kProject:
      return projected(a, b);
    case VectorMath::kReflect: {
      const Vec3f normal = unit(b);
      return a - normal * (2.0f * dot(a, normal));
    }
    case VectorMath::kRefract:
      return refracted(a, unit(b), scale);
    case VectorMath::kFaceforward:
      return dot(c, b) < 0.0f ? a : -a;
    case VectorMath::kDot:
      return even(dot(a, b));
    case VectorMath::kDistance:
      return even(length(a - b));
    case VectorMath::kLength:
      return even(length(a));
    case VectorMath::kScale:
      return a * scale;
    case VectorMath::kNormalize:
      return unit(a);
    case VectorMath::kAbsolute:
      return each([](float x) { return std::abs(x); }, a);
    case VectorMath::kPower:
      return each(power_of, a, b);
    case VectorMath::kSign:
      return each(sign_of, a);
    case VectorMath::kMinimum:
      return each([](float x, float y) { return std::min(x, y); }, a, b);
    case VectorMath::kMaximum:
      return each([](float x, float y) { return std::max(x, y); }, a, b);
    case VectorMath::kFloor:
      return each([](float x) { return std::floor(x); }, a);
    case VectorMath::kCeil:
      return each([](float x) { return std::ceil(x); }, a);
    case VectorMath::kFraction:
      return each([](float x) { return x - std::floor(x); }, a);
    case VectorMath::kModulo:
      return each(modulo, a, b);
    case VectorMath::kWrap:
      return each(wrapped, a, b, c);
    case VectorMath::kSnap:
      return each([](float x, float y) { return std::floor(divided(x, y)) * y; }, a, b);
    case VectorMath::kSine:
      return each([](float x) { return sine(x); }, a);
    case VectorMath::kCosine:
      return each([](float x) { return cosine(x); }, a);
    default:
      return each(tangent_of, a);  // kTangent
  }
}

Vec3f node_mix(std::uint8_t mode, Vec3f share, Vec3f a, Vec3f b) noexcept {
  const auto blend = static_cast<Blend>(mode);
  if (blend >= Blend::kHue) return tuned(blend, share.x, a, b);
  return each([blend](float s, float x, float y) { return blended(blend, s, x, y); }, share, a, b);
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
  return each([](float x) { return std::max(x, 0.0f); }, changed);
}

float node_map_range(std::uint8_t mode, float value, float from_min, float from_max, float to_min, float to_max,
                     float steps) noexcept {
  const auto range = static_cast<Range>(mode);
  if (from_max == from_min) return 0.0f;
  float factor = (value - from_min) / (from_max - from_min);
  if (range == Range::kStepped) factor = steps > 0.0f ? std::floor(factor * (steps + 1.0f)) / steps : 0.0f;
  if (range == Range::kSmoothstep || range == Range::kSmootherstep) factor = std::clamp(factor, 0.0f, 1.0f);
  if (range == Range::kSmoothstep) factor = (3.0f - 2.0f * factor) * (factor * factor);
  if (range == Range::kSmootherstep) {
    factor = factor * factor * factor * (factor * (factor * 6.0f - 15.0f) + 10.0f);
  }
  return to_min + factor * (to_max - to_min);
}

Vec3f node_mapping(std::uint8_t mode, Vec3f v, Vec3f location, Vec3f rotation, Vec3f scale) noexcept {
  const Turn turn = turn_of(rotation);
  switch (static_cast<Mapping>(mode)) {
    case Mapping::kTexture:
      return each(divided, turn.back(v - location), scale);
    case Mapping::kVector:
      return turn.of(v * scale);
    case Mapping::kNormal:
      return unit(turn.of(each(divided, v, scale)));
    default:
      return turn.of(v * scale) + location;  // kPoint
  }
}

Vec3f node_vector_rotate(std::uint8_t mode, Vec3f v, Vec3f center, Vec3f axis, float angle, Vec3f rotation,
                         bool inverts) noexcept {
  const auto kind = static_cast<Rotation>(mode);
  const Vec3f arm = v - center;
  if (kind == Rotation::kEuler) {
    const Turn turn = turn_of(rotation);
    return (inverts ? turn.back(arm) : turn.of(arm)) + center;
  }
  if (kind != Rotation::kAxisAngle) {
    axis = {kind == Rotation::kX ? 1.0f : 0.0f, kind == Rotation::kY ? 1.0f : 0.0f, kind == Rotation::kZ ? 1.0f : 0.0f};
  }
  const float size = length(axis);
  return size != 0.0f ? turned_about(arm, axis * (1.0f / size), inverts ? -angle : angle) + center : v;
}

float node_fresnel(float cosine, float eta) noexcept {
  const float c = std::abs(cosine), squared = eta * eta - 1.0f + c * c;
  if (!(squared > 0.0f)) return 1.0f;  // total reflection
  const float g = std::sqrt(squared), a = (g - c) / (g + c);
  const float b = ((g + c) * c - 1.0f) / ((g - c) * c + 1.0f);
  return 0.5f * a * a * (1.0f + b * b);
}

float node_facing(float cosine, float blend) noexcept {
  float facing = std::abs(cosine);
  if (blend != 0.5f) {
    blend = std::clamp(blend, 0.0f, 1.0f - 1e-5f);
    facing = power(facing, blend < 0.5f ? 2.0f * blend : 0.5f / (1.0f - blend));
  }
  return 1.0f - facing;
}

}  // namespace perfect_bvh
