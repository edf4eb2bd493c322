#include "render/modes/palette.h"

#include <algorithm>
#include <numbers>

#include "render/sampling/sampler.h"

namespace perfect_bvh {
namespace {

Vec3d linear_from_oklab(double lightness, double a, double b) noexcept {
  const auto cube = [](double x) { return x * x * x; };
  const double l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
  const double m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
  const double s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool on_screen(Vec3d color) noexcept {
  return std::min({color.x, color.y, color.z}) >= 0.0 && std::max({color.x, color.y, color.z}) <= 1.0;
}

}  // namespace

Vec3f color_from_lch(double lightness, double chroma, double hue) noexcept {
  const double angle = 2.0 * std::numbers::pi * hue;
  const auto [b, a] = sine_cosine(angle);
  double low = 0.0, high = chroma;
  if (!on_screen(linear_from_oklab(lightness, a * high, b * high))) {
    for (int i = 0; i < 12; ++i) {  // to 1/4096 of the chroma
      const double middle = 0.5 * (low + high);
      (on_screen(linear_from_oklab(lightness, a * middle, b * middle)) ? low : high) = middle;
    }
    high = low;
  }
  const Vec3f color = to_float(linear_from_oklab(lightness, a * high, b * high));
  return max(min(color, Vec3f{1, 1, 1}), Vec3f{0, 0, 0});
}

Vec3f id_color(std::uint32_t id) noexcept {
  // Golden-ratio steps keep the hues of any run of ids apart; lightness tells apart those that come close again.
  const std::uint32_t hue = id * 0x9e3779b9u;
  const std::uint32_t hash = sampling::mix(id + 1u);
  const double lightness = 0.58 + 0.26 * static_cast<double>(hash >> 16) * 0x1p-16;
  const double chroma = 0.10 + 0.07 * static_cast<double>(hash & 0xffffu) * 0x1p-16;
  return color_from_lch(lightness, chroma, static_cast<double>(hue) * 0x1p-32);
}

ColorRamp::ColorRamp() {
  for (int i = 0; i <= kCells; ++i) {
    const double amount = static_cast<double>(i) / kCells;
    const double lightness = 0.16 + 0.80 * amount;
    const double hue = 0.80 + 0.50 * amount;  // violet, magenta, red, orange, yellow
    const double chroma = 0.10 + 0.12 * sine(std::numbers::pi * amount);
    colors_[static_cast<std::size_t>(i)] = color_from_lch(lightness, chroma, hue);
  }
}

Vec3f ColorRamp::at(float amount) const noexcept {
  if (!(amount > 0.0f)) return colors_.front();
  if (amount >= 1.0f) return colors_.back();
  const float place = amount * static_cast<float>(kCells);
  const auto cell = static_cast<std::size_t>(place);
  const float part = place - static_cast<float>(cell);
  return colors_[cell] * (1.0f - part) + colors_[cell + 1] * part;
}

}  // namespace perfect_bvh
