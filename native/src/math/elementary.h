// Elementary functions made only of sums, products, quotients and square roots, so their bits are the same on every
// system. C libraries round the last digit differently, and if a path branches on it, an image differs by more than a
// digit. Angles are in radians. Errors are within four units in the last place of a double, unless noted.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

namespace perfect_bvh {

template <class T>
struct SineCosine {
  T sine, cosine;
};

namespace series {

// c[0] + c[1] x + c[2] x^2 ...
template <std::size_t N>
[[nodiscard]] constexpr double sum(const std::array<double, N>& c, double x) noexcept {
  double result = c[N - 1];
  for (std::size_t i = N - 1; i-- > 0;) result = result * x + c[i];
  return result;
}

// -1 / first!, 1 / (first + 2)!, ...: the first N coefficients of (sin r - r) / r^3 in r^2 for 3, of (cos r - 1) / r^2
// for 2, where |r| <= pi / 4.
template <std::size_t N>
[[nodiscard]] constexpr std::array<double, N> alternating_factorials(int first) noexcept {
  std::array<double, N> made{};
  double factorial = 1.0;
  for (int i = 2; i <= first; ++i) factorial *= i;
  double sign = -1.0;
  for (std::size_t i = 0; i < N; ++i) {
    made[i] = sign / factorial;
    sign = -sign;
    const double next = first + 2 * static_cast<double>(i);
    factorial *= (next + 1.0) * (next + 2.0);
  }
  return made;
}

// Uses series of this many terms: 6 are enough for a float, 9 for a double. From |angle| = 1e5 on, a turn is the double
// nearest to 2 pi, which acts like an error of the angle of up to 4e-17 |angle|.
template <std::size_t Terms>
[[nodiscard]] inline SineCosine<double> sine_cosine(double angle) noexcept {
  // High part with few enough bits that its multiples are exact, and the rest of pi / 2.
  constexpr double kHalfPiHigh = 0x1.921fb544p+0, kHalfPiLow = 0x1.0b4611a626331p-34;
  static constexpr auto kSine = alternating_factorials<Terms>(3), kCosine = alternating_factorials<Terms>(2);
  if (!(std::abs(angle) < 1e5)) angle = std::fmod(angle, 2.0 * std::numbers::pi);
  const double quarters = std::floor(angle * (2.0 / std::numbers::pi) + 0.5);
  const double r = (angle - quarters * kHalfPiHigh) - quarters * kHalfPiLow, square = r * r;
  const double sine = r + r * square * sum(kSine, square), cosine = 1.0 + square * sum(kCosine, square);
  const double quarter = quarters - 4.0 * std::floor(quarters * 0.25);
  if (quarter == 1.0) return {cosine, -sine};
  if (quarter == 2.0) return {-sine, -cosine};
  if (quarter == 3.0) return {-cosine, sine};
  return {sine, cosine};
}

}  // namespace series

// Returns the nearest floats, except for one in some thousands.
[[nodiscard]] inline SineCosine<float> sine_cosine(float angle) noexcept {
  const auto [sine, cosine] = series::sine_cosine<6>(static_cast<double>(angle));
  return {static_cast<float>(sine), static_cast<float>(cosine)};
}
[[nodiscard]] inline SineCosine<double> sine_cosine(double angle) noexcept { return series::sine_cosine<9>(angle); }

template <class T>
[[nodiscard]] T sine(T angle) noexcept {
  return sine_cosine(angle).sine;
}
template <class T>
[[nodiscard]] T cosine(T angle) noexcept {
  return sine_cosine(angle).cosine;
}

// Returns the angle of the point (x, y), from -pi to pi; 0 for (0, 0), NaN if both are infinite.
[[nodiscard]] double arc_tangent(double y, double x) noexcept;
// Returns -pi / 2 to pi / 2; x from -1 to 1.
[[nodiscard]] double arc_sine(double x) noexcept;
[[nodiscard]] double exponential(double x) noexcept;
[[nodiscard]] double logarithm(double x) noexcept;
[[nodiscard]] double logarithm2(double x) noexcept;
// base >= 0. Returns the nearest float, except for one in some thousands, if |exponent| is below a thousand.
[[nodiscard]] float power(float base, float exponent) noexcept;
// Returns the square root of x^2 + y^2 + z^2. The squares may be out of a double's range.
[[nodiscard]] double hypotenuse(double x, double y, double z = 0.0) noexcept;

}  // namespace perfect_bvh
