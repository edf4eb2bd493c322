// Elementary functions compared with those of the C library in long double, which has at least eleven bits more on
// Linux.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kTries = 200'000;

// The error in units of a double's last place at `truth`, or at `scale` if that is larger: near a zero of the sine,
// angles have no more digits.
double error_of(double found, long double truth, double scale = 0.0) {
  const double size = std::max(std::abs(static_cast<double>(truth)), scale);
  const double unit = std::nextafter(size, kInfinity) - size;
  return static_cast<double>(std::abs(static_cast<long double>(found) - truth)) / unit;
}

template <class Check>
void for_random(double low, double high, const Check& check) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> spread(low, high);
  for (int i = 0; i < kTries; ++i) check(spread(random));
}

TEST(Elementary, SinesAndCosinesOfDoubles) {
  double worst = 0.0;
  for_random(-100.0, 100.0, [&](double x) {
    const auto [sine, cosine] = sine_cosine(x);
    worst = std::max({worst, error_of(sine, std::sin(static_cast<long double>(x)), 1e-3),
                      error_of(cosine, std::cos(static_cast<long double>(x)), 1e-3)});
  });
  EXPECT_LT(worst, 2.0);
}

TEST(Elementary, SinesAndCosinesOfFloatsAreTheNearest) {
  int other = 0;
  for_random(-10.0, 10.0, [&](double x) {
    const auto angle = static_cast<float>(x);
    const auto [sine, cosine] = sine_cosine(angle);
    const auto wide = static_cast<long double>(angle);
    other += sine != static_cast<float>(std::sin(wide)), other += cosine != static_cast<float>(std::cos(wide));
  });
  EXPECT_LT(other, kTries / 1000);
}

TEST(Elementary, AnglesThatAreNoneOrHuge) {
  EXPECT_EQ(sine(0.0), 0.0);
  EXPECT_EQ(cosine(0.0f), 1.0f);
  EXPECT_NEAR(sine(std::numbers::pi / 2.0), 1.0, 1e-16);
  for (const double angle : {1e6, -1e12, 1e300}) {
    const auto [s, c] = sine_cosine(angle);
    EXPECT_NEAR(s * s + c * c, 1.0, 1e-12);
  }
  EXPECT_TRUE(std::isnan(sine(kInfinity)));
  EXPECT_TRUE(std::isnan(cosine(std::numeric_limits<float>::quiet_NaN())));
}

TEST(Elementary, ArcTangentsInAllQuarters) {
  double worst = 0.0;
  for_random(-4.0, 4.0, [&](double angle) {
    const double y = 3.0 * std::sin(angle), x = 3.0 * std::cos(angle);
    const auto truth = std::atan2(static_cast<long double>(y), static_cast<long double>(x));
    worst = std::max(worst, error_of(arc_tangent(y, x), truth));
  });
  EXPECT_LT(worst, 2.0);
  EXPECT_EQ(arc_tangent(0.0, 0.0), 0.0);
  EXPECT_EQ(arc_tangent(0.0, -2.0), std::numbers::pi);
  EXPECT_EQ(arc_tangent(-1.0, 0.0), -std::numbers::pi / 2.0);
  EXPECT_TRUE(std::isnan(arc_tangent(kInfinity, kInfinity)));
}

TEST(Elementary, ArcSines) {
  for_random(-1.0, 1.0, [](double x) { ASSERT_NEAR(arc_sine(x), std::asin(x), 1e-15); });
  EXPECT_EQ(arc_sine(1.0), std::numbers::pi / 2.0);
  EXPECT_EQ(arc_sine(-1.0), -std::numbers::pi / 2.0);
}

TEST(Elementary, ExponentialsAndLogarithms) {
  double worst = 0.0;
  for_random(-700.0, 700.0, [&](double x) {
    worst = std::max(worst, error_of(exponential(x), std::exp(static_cast<long double>(x))));
    const double y = std::exp(x / 100.0);
    worst = std::max(worst, error_of(logarithm(y), std::log(static_cast<long double>(y)), 1e-3));
    worst = std::max(worst, error_of(logarithm2(y), std::log2(static_cast<long double>(y)), 1e-3));
  });
  EXPECT_LT(worst, 4.0);
  EXPECT_EQ(exponential(0.0), 1.0);
  EXPECT_EQ(exponential(-kInfinity), 0.0);
  EXPECT_EQ(exponential(kInfinity), kInfinity);
  EXPECT_EQ(logarithm(1.0), 0.0);
  EXPECT_EQ(logarithm(0.0), -kInfinity);
  EXPECT_EQ(logarithm(kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(logarithm(-1.0)));
}

TEST(Elementary, PowersAreTheNearest) {
  int other = 0;
  std::mt19937 random(9);
  std::uniform_real_distribution<float> bases(0.0f, 4.0f), exponents(-3.0f, 48.0f);
  for (int i = 0; i < kTries; ++i) {
    const float base = bases(random), exponent = exponents(random);
    const auto truth = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    other += power(base, exponent) != static_cast<float>(truth);
  }
  EXPECT_LT(other, kTries / 1000);
  EXPECT_EQ(power(0.0f, 2.4f), 0.0f);
  EXPECT_EQ(power(0.0f, 0.0f), 1.0f);
  EXPECT_EQ(power(1.0f, 48.0f), 1.0f);
  EXPECT_EQ(power(0.0f, -1.0f), std::numeric_limits<float>::infinity());
}

TEST(Elementary, HypotenusesOfAnySize) {
  for (const double scale : {1.0, 1e-200, 1e200, 5e-324, 1e308}) {
    const double x = 0.6 * scale, y = -0.3 * scale, z = 0.2 * scale;
    const auto truth =
        std::hypot(static_cast<long double>(x), static_cast<long double>(y), static_cast<long double>(z));
    EXPECT_LE(error_of(hypotenuse(x, y, z), truth), 1.5) << scale;
  }
  EXPECT_EQ(hypotenuse(3.0, 4.0), 5.0);
  EXPECT_EQ(hypotenuse(0.0, 0.0), 0.0);
  EXPECT_EQ(hypotenuse(-kInfinity, 1.0), kInfinity);
}

}  // namespace
}  // namespace perfect_bvh
