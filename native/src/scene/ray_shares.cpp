#include "scene/ray_shares.h"

#include <cmath>

namespace perfect_bvh {
namespace {

Vec3d magnitudes(Vec3d v) noexcept { return {std::abs(v.x), std::abs(v.y), std::abs(v.z)}; }

}  // namespace

void RayShares::add(const Aabb& box, const Affine& map, std::size_t row) noexcept {
  if (box.is_empty()) return;
  const Vec3d least = to_double(box.lower), greatest = to_double(box.upper);
  const Vec3d middle = map.point((least + greatest) * 0.5), half = (greatest - least) * 0.5;
  const Vec3d reach = magnitudes(map.x) * half.x + magnitudes(map.y) * half.y + magnitudes(map.z) * half.z;
  lower_ = is_empty_ ? middle - reach : min(lower_, middle - reach);
  upper_ = is_empty_ ? middle + reach : max(upper_, middle + reach);
  is_empty_ = false;
  if (row != kOther) areas_[row] += half_area(reach * 2.0);
}

double RayShares::of(std::size_t row) const noexcept {
  if (is_empty_) return 0;
  const double whole = half_area(upper_ - lower_);
  return whole > 0 ? areas_[row] / whole : 1;
}

}  // namespace perfect_bvh
