#include "math/elementary.h"

#include <algorithm>

namespace perfect_bvh {
namespace {

constexpr double kPi = std::numbers::pi, kInfinity = std::numeric_limits<double>::infinity();
// High part with few enough bits that its multiples are exact, and the rest of log 2.
constexpr double kLog2High = 0x1.62e42ffp-1, kLog2Low = -0x1.718432a1b0e26p-35;

// 1, 1/3, 1/5, ...; every second one is negative if `alternating`.
template <std::size_t N>
constexpr std::array<double, N> reciprocals(bool alternating) noexcept {
  std::array<double, N> made{};
  for (std::size_t i = 0; i < N; ++i)
    made[i] = (alternating && i % 2 == 1 ? -1.0 : 1.0) / static_cast<double>(2 * i + 1);
  return made;
}

template <std::size_t N>
constexpr std::array<double, N> inverse_factorials() noexcept {
  std::array<double, N> made{};
  double factorial = 1.0;
  for (std::size_t i = 0; i < N; ++i) {
    made[i] = 1.0 / factorial;
    factorial *= static_cast<double>(i + 1);
  }
  return made;
}

// atan(i / 8)
constexpr std::array<double, 9> kArcTangents{0x0.0p+0,
                                             0x1.fd5ba9aac2f6ep-4,
                                             0x1.f5b75f92c80ddp-3,
                                             0x1.6f61941e4def1p-2,
                                             0x1.dac670561bb4fp-2,
                                             0x1.1e00babdefeb4p-1,
                                             0x1.4978fa3269ee1p-1,
                                             0x1.700a7c5784634p-1,
                                             0x1.921fb54442d18p-1};

}  // namespace

double arc_tangent(double y, double x) noexcept {
  const double rise = std::abs(y), run = std::abs(x);
  if (rise == 0.0 && run == 0.0) return 0.0;
  const double ratio = std::min(rise, run) / std::max(rise, run);
  if (!(ratio >= 0.0 && ratio <= 1.0)) return std::numeric_limits<double>::quiet_NaN();
  // The series converges fast around the nearest eighth: atan a = atan b + atan((a - b) / (1 + a b)).
  const double eighths = std::floor(ratio * 8.0 + 0.5), nearest = eighths / 8.0;
  const double rest = (ratio - nearest) / (1.0 + ratio * nearest);
  static constexpr auto kSeries = reciprocals<8>(true);
  double angle = kArcTangents[static_cast<std::size_t>(eighths)] + rest * series::sum(kSeries, rest * rest);
  if (rise > run) angle = 0.5 * kPi - angle;
  if (x < 0.0) angle = kPi - angle;
  return y < 0.0 ? -angle : angle;
}

double arc_sine(double x) noexcept { return arc_tangent(x, std::sqrt(std::max((1.0 - x) * (1.0 + x), 0.0))); }

double exponential(double x) noexcept {
  if (!(x > -745.5)) return std::isnan(x) ? x : 0.0;
  if (x > 709.8) return kInfinity;
  const double doublings = std::floor(x * std::numbers::log2e + 0.5);
  const double rest = (x - doublings * kLog2High) - doublings * kLog2Low;
  static constexpr auto kSeries = inverse_factorials<15>();
  return std::ldexp(series::sum(kSeries, rest), static_cast<int>(doublings));
}

double logarithm(double x) noexcept {
  if (!(x > 0.0)) return x == 0.0 ? -kInfinity : std::numeric_limits<double>::quiet_NaN();
  if (x == kInfinity) return x;
  int doublings = 0;
  double part = std::frexp(x, &doublings);  // 1/2 to 1, then about 1
  if (part < 0.5 * std::numbers::sqrt2) part *= 2.0, --doublings;
  // log a = 2 atanh((a - 1) / (a + 1))
  const double s = (part - 1.0) / (part + 1.0);
  static constexpr auto kSeries = reciprocals<11>(false);
  return doublings * kLog2High + (2.0 * s * series::sum(kSeries, s * s) + doublings * kLog2Low);
}

double logarithm2(double x) noexcept { return logarithm(x) * std::numbers::log2e; }

float power(float base, float exponent) noexcept {
  if (exponent == 0.0f) return 1.0f;
  return static_cast<float>(exponential(static_cast<double>(exponent) * logarithm(static_cast<double>(base))));
}

double hypotenuse(double x, double y, double z) noexcept {
  const double square = x * x + y * y + z * z;
  if (square > 1e-280 && square < 1e280) return std::sqrt(square);
  const double longest = std::max({std::abs(x), std::abs(y), std::abs(z)});
  if (!(longest > 0.0 && longest < kInfinity)) return std::sqrt(square);
  int exponent = 0;
  static_cast<void>(std::frexp(longest, &exponent));
  const double a = std::ldexp(x, -exponent), b = std::ldexp(y, -exponent), c = std::ldexp(z, -exponent);
  return std::ldexp(std::sqrt(a * a + b * b + c * c), exponent);
}

}  // namespace perfect_bvh
