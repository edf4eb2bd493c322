#include "render/film.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace perfect_bvh {
namespace {

// The window over [0, 1]; 1 at the middle, nearly 0 at the ends.
double blackman_harris(double place) noexcept {
  const double angle = 2.0 * std::numbers::pi * place;
  return 0.35875 - 0.48829 * std::cos(angle) + 0.14128 * std::cos(2.0 * angle) - 0.01168 * std::cos(3.0 * angle);
}

}  // namespace

PixelFilter::PixelFilter(float width) {
  constexpr int kSteps = 16384;
  std::vector<double> cumulative(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const auto row = static_cast<std::size_t>(i);
    cumulative[row + 1] = cumulative[row] + blackman_harris((i + 0.5) / kSteps);
  }
  std::size_t step = 0;
  for (int cell = 0; cell <= kCells; ++cell) {
    const double wanted = cumulative[kSteps] * cell / kCells;
    while (step + 1 < kSteps && cumulative[step + 1] < wanted) ++step;
    const double part = (wanted - cumulative[step]) / (cumulative[step + 1] - cumulative[step]);
    const double place = (static_cast<double>(step) + part) / kSteps;
    inverse_[static_cast<std::size_t>(cell)] = static_cast<float>((2.0 * place - 1.0) * static_cast<double>(width));
  }
}

}  // namespace perfect_bvh
