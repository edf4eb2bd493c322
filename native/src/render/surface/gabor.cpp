#include "render/surface/gabor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "render/surface/texture_space.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kPoints = 8;  // in each cell
constexpr float kLeastFrequency = 1e-3f;
constexpr float kDeviations = 6.0f;  // the range of values, in standard deviations, that becomes 0 to 1

// A wave of unit amplitude, and the same wave shifted by a quarter period.
struct Phasor {
  float real = 0.0f, imaginary = 0.0f;
};

// Returns the unit vector of a point's wave, turned randomly. `seed` is the cell, and the number of the point in it.
Coordinates<2> way_of(const GaborSettings& settings, float isotropy, const Coordinates<3>& seed) noexcept {
  const float chance = (random_of(seed[0], seed[1], seed[2]) - 0.5f) * kPi;
  const auto [sine, cosine] = sine_cosine(settings.angle + chance * isotropy);
  return {cosine, sine};
}
Coordinates<3> way_of(const GaborSettings& settings, float isotropy, const Coordinates<4>& seed) noexcept {
  const Vec3f way = settings.orientation * (1.0f / length(settings.orientation)), chances = random_color(seed) * kPi;
  if (isotropy == 0.0f) return {way.x, way.y, way.z};
  const double x = static_cast<double>(way.x), y = static_cast<double>(way.y), z = static_cast<double>(way.z);
  const auto inclination = sine_cosine(static_cast<float>(arc_tangent(hypotenuse(x, y), z)) + chances.x * isotropy);
  const auto azimuth = sine_cosine(static_cast<float>(arc_tangent(y, x)) + chances.y * isotropy);
  return {inclination.sine * azimuth.cosine, inclination.sine * azimuth.sine, inclination.cosine};
}

Coordinates<2> random_place(const Coordinates<3>& seed) noexcept {
  return {random_of(seed[0], seed[1], seed[2]), random_of(seed[2], seed[0], seed[1])};
}
Coordinates<3> random_place(const Coordinates<4>& seed) noexcept {
  const Vec3f place = random_color(seed);
  return {place.x, place.y, place.z};
}

// A wave under a Gaussian, which a Hann window ends at distance 1; zero beyond it.
template <std::size_t N>
Phasor kernel(const Coordinates<N>& offset, float square, const Coordinates<N>& waves) noexcept {
  const float window = 0.5f + 0.5f * cosine(kPi * square);
  const float height = window * static_cast<float>(exponential(static_cast<double>(-kPi * square)));
  const auto [sine, cosine] = sine_cosine(2.0f * kPi * inner(offset, waves));
  return {height * cosine, height * sine};
}

template <std::size_t N>
void add_cell(const Coordinates<N>& cell, const Coordinates<N>& place, const GaborSettings& settings,
              Phasor& sum) noexcept {
  const float isotropy = 1.0f - clamped(settings.anisotropy, 0.0f, 1.0f);
  Coordinates<N + 1> seed{};
  std::copy(cell.begin(), cell.end(), seed.begin());
  const auto seeded = [&seed](int number) -> const Coordinates<N + 1>& {
    seed[N] = static_cast<float>(number);
    return seed;
  };
  for (int i = 0; i < kPoints; ++i) {
    const Coordinates<N> offset = place - random_place(seeded(3 * i + 1));
    const float square = inner(offset, offset);
    if (!(square < 1.0f)) continue;
    const float sign = random_place(seeded(3 * i + 2))[0] < 0.5f ? -1.0f : 1.0f;
    const float frequency = std::max(settings.frequency, kLeastFrequency);
    const Phasor wave = kernel(offset, square, way_of(settings, isotropy, seeded(3 * i)) * frequency);
    sum = {sum.real + sign * wave.real, sum.imaginary + sign * wave.imaginary};
  }
}

template <std::size_t N>
Phasor noise(const Coordinates<N>& p, const GaborSettings& settings) noexcept {
  const Coordinates<N> cell = each_axis<N>([&](std::size_t i) { return std::floor(p[i]); });
  Phasor sum;
  for (int number = 0; number < (N == 2 ? 9 : 27); ++number) {
    const int steps[3] = {number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1};
    const Coordinates<N> step = each_axis<N>([&](std::size_t i) { return static_cast<float>(steps[i]); });
    add_cell(cell + step, (p - cell) - step, settings, sum);
  }
  return sum;
}

}  // namespace

Vec3f gabor_noise(const GaborSettings& settings, Vec3f p) noexcept {
  // For weights of one magnitude and the integral of the squared kernel, if waves are short compared with the Gaussian.
  const float integral = settings.is_flat ? 0.25f : 0.25f / std::numbers::sqrt2_v<float>;
  const float range = kDeviations * std::sqrt(static_cast<float>(kPoints) * 0.5f * integral);
  const Phasor sum = settings.is_flat ? noise(coordinates_of<2>(p, 0.0f, settings.scale), settings)
                                      : noise(coordinates_of<3>(p, 0.0f, settings.scale), settings);
  const double phase = arc_tangent(static_cast<double>(sum.imaginary), static_cast<double>(sum.real));
  const float size = std::sqrt(sum.real * sum.real + sum.imaginary * sum.imaginary);
  return {sum.imaginary / range * 0.5f + 0.5f,
          static_cast<float>((phase + std::numbers::pi) / (2.0 * std::numbers::pi)), size / range};
}

}  // namespace perfect_bvh
