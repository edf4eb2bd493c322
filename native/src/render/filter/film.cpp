#include "render/filter/film.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

// The window over [0, 1]; 1 at the middle, nearly 0 at the ends.
double blackman_harris(double place) noexcept {
  const double c = cosine(2.0 * std::numbers::pi * place);  // of the double and the threefold angle as well:
  return 0.35875 - 0.48829 * c + 0.14128 * (2.0 * c * c - 1.0) - 0.01168 * c * (4.0 * c * c - 3.0);
}

}  // namespace

PixelFilter::PixelFilter(float width)
    : width_(width),
      cells_per_pixel_(width > 0.0f ? static_cast<float>(kCells) / (2.0f * width) : 0.0f),
      reach_(std::max(static_cast<int>(std::ceil(width - 0.5f)), 0)) {
  constexpr int kSteps = 16384;
  std::vector<double> cumulative(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const auto row = static_cast<std::size_t>(i);
    cumulative[row + 1] = cumulative[row] + blackman_harris((i + 0.5) / kSteps);
  }
  std::size_t step = 0;
  for (int cell = 0; cell <= kCells; ++cell) {
    const auto row = static_cast<std::size_t>(cell);
    heights_[row] = static_cast<float>(blackman_harris(static_cast<double>(cell) / kCells));
    const double wanted = cumulative[kSteps] * cell / kCells;
    while (step + 1 < kSteps && cumulative[step + 1] < wanted) ++step;
    const double part = (wanted - cumulative[step]) / (cumulative[step + 1] - cumulative[step]);
    const double place = (static_cast<double>(step) + part) / kSteps;
    inverse_[row] = static_cast<float>((2.0 * place - 1.0) * static_cast<double>(width));
  }
}

void PixelFilter::weigh(float offset, Weights& weights) const noexcept {
  for (int step = -reach_; step <= reach_; ++step) {
    const float place = (static_cast<float>(step) - offset + width_) * cells_per_pixel_;
    const bool inside = place >= 0.0f && place < static_cast<float>(kCells);
    weights[static_cast<std::size_t>(step + reach_)] = inside ? look_up(heights_, place) : 0.0f;
  }
}

Film::Film(const TileGrid& grid, const PixelFilter& filter, bool has_guides)
    : grid_(grid),
      filter_(filter),
      reach_(filter.reach()),
      has_guides_(has_guides),
      tiles_(grid.count()),
      guides_(has_guides ? grid.count() : 0) {}

void Film::begin(std::size_t tile) {
  tiles_[tile].assign(stride() * stride(), Sum{});
  if (has_guides_) guides_[tile].assign(stride() * stride(), Guides{});
}

void Film::add(std::size_t tile, std::span<const Pixel> pixels, std::span<const Point2> offsets,
               std::span<const Rgba> colors, std::span<const Vec3f> albedos, std::span<const Vec3f> normals) noexcept {
  const PixelRect whole = grid_.whole_at(tile);
  const auto taps = static_cast<std::size_t>(2 * reach_ + 1);
  PixelFilter::Weights along_x, along_y;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    filter_.weigh(offsets[i].x, along_x);
    filter_.weigh(offsets[i].y, along_y);
    const Rgba color = colors[i];
    // The tile's border is as wide as the filter's reach: the first tap is the pixel's own place in it.
    std::size_t row =
        static_cast<std::size_t>(pixels[i].y - whole.y0) * stride() + static_cast<std::size_t>(pixels[i].x - whole.x0);
    for (std::size_t y = 0; y < taps; ++y, row += stride()) {
      for (std::size_t x = 0; x < taps; ++x) {
        const float weight = along_y[y] * along_x[x];
        Sum& sum = tiles_[tile][row + x];
        sum.color = {sum.color.r + weight * color.r, sum.color.g + weight * color.g, sum.color.b + weight * color.b,
                     sum.color.a + weight * color.a};
        sum.weight += weight;
        if (!has_guides_) continue;
        Guides& guides = guides_[tile][row + x];
        guides.albedo = guides.albedo + albedos[i] * weight;
        guides.normal = guides.normal + normals[i] * weight;
      }
    }
  }
}

FilmColor Film::pixel(int x, int y) const noexcept {
  Sum all;
  Guides guides;
  grid_.visit({std::max(x - reach_, 0), std::max(y - reach_, 0), x + reach_ + 1, y + reach_ + 1},
              [&](std::size_t tile) {
                const PixelRect whole = grid_.whole_at(tile);
                const std::size_t row = static_cast<std::size_t>(y - whole.y0 + reach_) * stride() +
                                        static_cast<std::size_t>(x - whole.x0 + reach_);
                const Sum& sum = tiles_[tile][row];
                all.color = {all.color.r + sum.color.r, all.color.g + sum.color.g, all.color.b + sum.color.b,
                             all.color.a + sum.color.a};
                all.weight += sum.weight;
                if (!has_guides_) return;
                guides.albedo = guides.albedo + guides_[tile][row].albedo;
                guides.normal = guides.normal + guides_[tile][row].normal;
              });
  // Divided, not multiplied: what is opaque in every sample then has an alpha of exactly 1.
  const float weight = all.weight;
  return {{all.color.r / weight, all.color.g / weight, all.color.b / weight, all.color.a / weight},
          guides.albedo * (1.0f / weight),
          guides.normal * (1.0f / weight)};
}

}  // namespace perfect_bvh
