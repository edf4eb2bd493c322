// The pixel filter, by importance sampling: samples are drawn from the filter's shape and all weigh the same, so
// that a pixel needs no neighbour's samples and tiles stay independent (Ernst et al. 2006).
// The shape is the Blackman-Harris window (Harris 1978), as in Cycles.
#pragma once

#include <array>

#include "render/sampler.h"

namespace perfect_bvh {

class PixelFilter {
 public:
  // width: the filter reaches this many pixels to each side. 0: every sample at the pixel's centre.
  explicit PixelFilter(float width);

  // From a point in [0, 1)^2 to an offset from the pixel's centre, in pixels.
  [[nodiscard]] Point2 offset(Point2 uniform) const noexcept { return {along_axis(uniform.x), along_axis(uniform.y)}; }

 private:
  static constexpr int kCells = 1024;
  [[nodiscard]] float along_axis(float uniform) const noexcept {
    const float place = uniform * static_cast<float>(kCells);
    const int cell = static_cast<int>(place);
    const float part = place - static_cast<float>(cell);
    const float low = inverse_[static_cast<std::size_t>(cell)], high = inverse_[static_cast<std::size_t>(cell) + 1];
    return low + (high - low) * part;
  }

  std::array<float, kCells + 1> inverse_{};  // of the cumulative distribution
};

}  // namespace perfect_bvh
