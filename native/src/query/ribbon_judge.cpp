#include "query/ribbon_judge.h"

#include <algorithm>
#include <cmath>

namespace perfect_bvh {
namespace {

// From where to where on the axis the ray may come nearest to it: outside of 0 to 1 if that would be beyond its ends.
struct Shares {
  double low, high;
};

// The axis, seen along the ray, is so long: moving its ends moves the place the more the shorter that is, and the
// farther the ray passes it.
Shares shares_of(const NearestToCentre& first, const NearestToCentre& last, double distance, double margin) noexcept {
  double step[3];
  for (int i = 0; i < 3; ++i) step[i] = last.point[i] - first.point[i];
  const double length = std::sqrt(dot_of(step, step));
  if (!(length > 16 * margin)) return {-1.0, 2.0};
  const double share = -dot_of(first.point, step) / (length * length);
  const double off = 16 * margin / length * (1 + distance / length + std::abs(share));
  return {share - off, share + off};
}

}  // namespace

JudgedRibbon judge_ribbon(const RoundRay& ray, const RoundEnds& ends, SegmentCode code, double margin) noexcept {
  const NearestToCentre first = nearest_to_centre(ray, ends.first), last = nearest_to_centre(ray, ends.last);
  const double distance = std::sqrt(place_on_ribbon(ray, ends.first, ends.last).squared);
  const Shares shares = shares_of(first, last, distance, margin);
  const double low = std::clamp(shares.low, 0.0, 1.0), high = std::clamp(shares.high, 0.0, 1.0);
  const auto [thin, thick] =
      std::minmax({radius_at(ends.first, ends.last, low), radius_at(ends.first, ends.last, high)});
  const bool cuts_first = (code & kSegmentBefore) == 0, cuts_last = (code & kSegmentAfter) == 0;
  const bool is_cut = (cuts_first && shares.high < 0) || (cuts_last && shares.low > 1);
  const bool may_be_cut = (cuts_first && shares.low < 0) || (cuts_last && shares.high > 1);
  const auto [t_low, t_high] = std::minmax({first.t + low * (last.t - first.t), first.t + high * (last.t - first.t)});
  const double slack = margin / std::sqrt(ray.squared_length);
  const double nearest = std::max(distance - margin, 0.0), farthest = distance + margin;
  return {
      !is_cut && nearest <= thick, !may_be_cut && farthest <= thin, t_low - slack, t_high + slack, nearest, farthest};
}

}  // namespace perfect_bvh
