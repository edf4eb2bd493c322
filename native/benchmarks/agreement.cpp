#include "agreement.h"

#include <algorithm>
#include <cmath>

namespace perfect_bvh::bench {

Agreement compare(std::span<const Hit> hits, std::span<const Hit> expected, double diagonal) {
  Agreement result;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Hit &hit = hits[i], &other = expected[i];
    if (!hit.found() && !other.found()) continue;
    const auto t = static_cast<double>(hit.t), other_t = static_cast<double>(other.t);
    const double tolerance = std::max(1e-5 * std::abs(other_t), 1e-7 * diagonal);
    if (hit.found() != other.found() || !(std::abs(t - other_t) <= tolerance)) {
      ++result.different;
    } else if (hit.primitive_index != other.primitive_index || hit.instance_index != other.instance_index) {
      ++result.other_triangle;
    }
  }
  return result;
}

Agreement compare(std::span<const std::uint8_t> occluded, std::span<const std::uint8_t> expected) {
  Agreement result;
  for (std::size_t i = 0; i < occluded.size(); ++i) result.different += occluded[i] != expected[i] ? 1 : 0;
  return result;
}

}  // namespace perfect_bvh::bench
