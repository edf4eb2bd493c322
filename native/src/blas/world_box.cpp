#include "blas/world_box.h"

#include <algorithm>
#include <cmath>

#include "math/axes.h"
#include "math/float4.h"

namespace perfect_bvh {
namespace {

constexpr Vec3d row_of(const Affine& map, int axis) noexcept { return {map.x[axis], map.y[axis], map.z[axis]}; }

// From `origin` on.
RowRange range_along(Vec3d row, const Aabb& box, double origin = 0) noexcept {
  RowRange range{origin, origin};
  for_each_axis([&](auto i) {
    const double lower = row[i] * static_cast<double>(box.lower[i]), upper = row[i] * static_cast<double>(box.upper[i]);
    range.least += std::min(lower, upper);
    range.greatest += std::max(lower, upper);
  });
  return range;
}

// Around the vertices under a map's linear part, in float: a nanosecond each.
Box4 turned_box(const Mesh& mesh, const Affine& map) noexcept {
  const auto column = [](Vec3d v) {
    return Float4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0.0f);
  };
  const Float4 x = column(map.x), y = column(map.y), z = column(map.z);
  Box4 box = Box4::empty();
  for (const Vec3f p : mesh.positions) box.grow(x * Float4(p.x) + y * Float4(p.y) + z * Float4(p.z));
  return box;
}

// The same around balls: beyond its centre a ball reaches its radius times the length of a row.
Box4 turned_balls(const Mesh& mesh, const Affine& map) noexcept {
  const auto column = [](Vec3d v) {
    return Float4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0.0f);
  };
  const Float4 x = column(map.x), y = column(map.y), z = column(map.z);
  const Float4 lengths = column({length(row_of(map, 0)), length(row_of(map, 1)), length(row_of(map, 2))});
  Box4 box = Box4::empty();
  for (const Ball& ball : mesh.balls) {
    const Vec3f p = ball.centre;
    const Float4 centre = x * Float4(p.x) + y * Float4(p.y) + z * Float4(p.z), reach = lengths * Float4(ball.radius);
    box.grow({centre - reach, centre + reach});
  }
  return box;
}

// Below it, float loses more of a row than the margin makes up for.
constexpr double kSmallestRow = 1e-30;

}  // namespace

double reach_of(const Aabb& box) noexcept {
  if (box.is_empty()) return 0;
  double reach = 0;
  for (int axis = 0; axis < 3; ++axis) {
    reach = std::max(
        {reach, static_cast<double>(std::abs(box.lower[axis])), static_cast<double>(std::abs(box.upper[axis]))});
  }
  return reach;
}

Aabb box_of_ranges(const RowRange (&ranges)[3], double reach, const Affine& map) noexcept {
  Aabb box;
  for_each_axis([&](auto axis) {
    const Vec3d row = row_of(map, axis);
    const double margin = 0x1p-16 * reach * (std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
    const double lower = map.translation[axis] + (ranges[axis].least - margin);
    const double upper = map.translation[axis] + (ranges[axis].greatest + margin);
    // Half a unit of float is added whichever way the narrowing goes.
    box.lower[axis] = static_cast<float>(lower - (0x1p-23 * std::abs(lower) + 0x1p-140));
    box.upper[axis] = static_cast<float>(upper + (0x1p-23 * std::abs(upper) + 0x1p-140));
  });
  return box;
}

Aabb transformed_bounds(const Aabb& box, const Affine& map) noexcept {
  if (box.is_empty()) return {};
  const RowRange ranges[3] = {range_along(row_of(map, 0), box), range_along(row_of(map, 1), box),
                              range_along(row_of(map, 2), box)};
  return box_of_ranges(ranges, reach_of(box), map);
}

Aabb transformed_bounds(const Mesh& mesh, const Aabb& box, const Affine& map) noexcept {
  if (box.is_empty()) return {};
  const Box4 turned = mesh.is_round() ? turned_balls(mesh, map) : turned_box(mesh, map);
  alignas(16) float lower[4], upper[4];
  turned.lower.store(lower), turned.upper.store(upper);
  RowRange ranges[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d row = row_of(map, axis);
    ranges[axis] = range_along(row, box);  // for vertices that no triangle has
    if (!(std::max({std::abs(row.x), std::abs(row.y), std::abs(row.z)}) > kSmallestRow)) continue;
    ranges[axis].least = std::max(ranges[axis].least, static_cast<double>(lower[axis]));
    ranges[axis].greatest = std::min(ranges[axis].greatest, static_cast<double>(upper[axis]));
  }
  return box_of_ranges(ranges, reach_of(box), map);
}

Aabb transformed_box(const Aabb& box, const Affine& map) noexcept {
  if (box.is_empty()) return {};
  Aabb result;
  for_each_axis([&](auto axis) {
    const RowRange range = range_along(row_of(map, axis), box, map.translation[axis]);
    result.lower[axis] = static_cast<float>(range.least);
    result.upper[axis] = static_cast<float>(range.greatest);
  });
  return result;
}

bool keeps_axes(const Affine& map) noexcept {
  bool keeps = true;
  for_each_axis([&](auto axis) {
    const Vec3d row = row_of(map, axis);
    keeps &= (row.x != 0) + (row.y != 0) + (row.z != 0) <= 1;
  });
  return keeps;
}

}  // namespace perfect_bvh
