#include "render/surface/hair_lobe.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

constexpr double kPi = std::numbers::pi, kLeastRoughness = 0.001, kLeastCosine = 1e-3;

double tangent(double angle) noexcept {
  const auto [sine, cosine] = sine_cosine(angle);
  return sine / cosine;
}

double roughness_of(float given, float least) noexcept {
  return std::clamp(static_cast<double>(std::max(given, least)), kLeastRoughness, 1.0);
}

}  // namespace

StrandLobe::StrandLobe(const HairLobe& lobe, bool passes, const HairDirection& view, float least) noexcept
    : passes_(passes),
      along_(roughness_of(lobe.along, least)),
      across_(roughness_of(lobe.across, least)),
      offset_(static_cast<double>(lobe.offset)),
      view_(arc_tangent(view.sine, view.cosine)),
      first_(arc_tangent(0.5 * (view_ - 0.5 * kPi) - offset_, along_)),
      last_(arc_tangent(0.5 * (view_ + 0.5 * kPi) - offset_, along_)),
      half_around_(arc_tangent(0.5 * kPi, across_)) {}

double StrandLobe::along(const HairDirection& direction) const noexcept {
  if (direction.cosine < kLeastCosine) return 0.0;
  const double turned = 0.5 * (arc_tangent(direction.sine, direction.cosine) + view_) - offset_;
  const double spread = turned * turned + along_ * along_;
  return along_ / (2.0 * spread * (last_ - first_) * direction.cosine);
}

double StrandLobe::around(double angle) const noexcept {
  if (passes_) {
    const double away = kPi - std::abs(angle);
    return across_ / (2.0 * half_around_ * (away * away + across_ * across_));
  }
  const double widened = std::abs(angle) / across_;
  return widened < kPi ? 0.25 * cosine(0.5 * widened) / across_ : 0.0;
}

double StrandLobe::density(const HairDirection& direction) const noexcept {
  if (passes_ && std::abs(direction.around) < 0.5 * kPi) return 0.0;
  return along(direction) * around(direction.around);
}

double StrandLobe::lit(const HairDirection& direction, bool is_beyond) const noexcept {
  if (passes_ ? !is_beyond : !is_beyond && std::abs(direction.around) > 0.5 * kPi) return 0.0;
  return along(direction) * around(direction.around);
}

HairDirection StrandLobe::sample(Point2 random) const noexcept {
  const double share = static_cast<double>(random.x), side = static_cast<double>(random.y);
  const double turned = along_ * tangent(first_ + share * (last_ - first_));
  const auto [sine, cosine] = sine_cosine(2.0 * (turned + offset_) - view_);
  double around = 0.0;
  if (passes_) {
    const double away = across_ * tangent(half_around_ * (2.0 * side - 1.0));
    around = away > 0.0 ? away - kPi : away + kPi;
  } else {
    around = 2.0 * across_ * arc_sine(1.0 - 2.0 * side);
  }
  return {sine, cosine, around};
}

}  // namespace perfect_bvh
