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
enum class Range : std::uint8_t { kLinear, kStepped, kSmoothstep, kSmootherstep };
constexpr std::uint8_t kVectorRanges = 4;  // the first vector mode of a range

// Applies a function of doubles to floats.
template <class Function, class... Floats>
float by_double(Function function, Floats... values) noexcept {
  return static_cast<float>(function(static_cast<double>(values)...));
}

float divided(float a, float b) noexcept { return b != 0.0f ? a / b : 0.0f; }

// Negative bases only have integer powers.
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

// Applies per component.
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

}  // namespace

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

float node_map_range(std::uint8_t mode, float value, float from_min, float from_max, float to_min, float to_max,
                     float steps) noexcept {
  const bool is_vector = mode >= kVectorRanges;
  const auto range = static_cast<Range>(is_vector ? mode - kVectorRanges : mode);
  if (from_max == from_min) return is_vector ? to_min : 0.0f;
  float factor = (value - from_min) / (from_max - from_min);
  if (range == Range::kStepped) factor = steps > 0.0f ? std::floor(factor * (steps + 1.0f)) / steps : 0.0f;
  if (range == Range::kSmoothstep || range == Range::kSmootherstep) factor = std::clamp(factor, 0.0f, 1.0f);
  if (range == Range::kSmoothstep) factor = (3.0f - 2.0f * factor) * (factor * factor);
  if (range == Range::kSmootherstep) {
    factor = factor * factor * factor * (factor * (factor * 6.0f - 15.0f) + 10.0f);
  }
  return to_min + factor * (to_max - to_min);
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
