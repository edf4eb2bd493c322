#include "blas/world_box.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "math/float4.h"
#include "math/vec3.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// Returns 0, 1 or 2 in each lane.
Int4 pick_axis(Int4 is_y, Int4 is_z) noexcept { return (is_z & Int4(2)) | ((is_y & (is_z ^ Int4(-1))) & Int4(1)); }

// Finds the vertex or sphere of a tree that is farthest along a direction. Each search starts with the result of the
// last: if the directions are similar, almost no box reaches farther.
class Search {
 public:
  Search(const WideBvh& tree, const Mesh& mesh) : tree_(tree), mesh_(mesh) {
    waiting_.push_back({0.0f, tree.root});
    direction_ = {1, 0, 0};
    reach_ = -Aabb::kInfinity;
    visit_all();
  }

  [[nodiscard]] float farthest(Vec3f direction) {
    direction_ = direction;
    reach_ = reach_of(farthest_);
    waiting_.push_back({Aabb::kInfinity, tree_.root});
    visit_all();
    return reach_;
  }

 private:
  struct Waiting {
    float bound;
    std::uint32_t child;
  };

  void visit_all() {
    while (!waiting_.empty()) {
      const Waiting now = waiting_.back();
      waiting_.pop_back();
      if (now.bound <= reach_) continue;
      if (now.child >= kBlockChild) {
        visit_leaf(now.child - kBlockChild);
      } else {
        visit_node(tree_.nodes[now.child]);
      }
    }
  }

  // The reaches of eight points, and a bit for each that is farther than the farthest so far.
  struct Eight {
    alignas(16) std::array<float, 8> reaches;
    std::uint32_t farther;
  };

  // The coordinates are 16-byte aligned. Empty boxes reach minus infinity or NaN.
  [[nodiscard]] Eight along_direction(const float* x, const float* y, const float* z) const noexcept {
    Eight eight;
    eight.farther = 0;
    const Float4 dx(direction_.x), dy(direction_.y), dz(direction_.z), reach(reach_);
    for (std::uint32_t i = 0; i < 8; i += 4) {
      const Float4 four = dx * Float4::load(x + i) + dy * Float4::load(y + i) + dz * Float4::load(z + i);
      four.store(&eight.reaches[i]);
      eight.farther |= equal_lanes(less(reach, four), Int4(-1)) << i;
    }
    return eight;
  }

  // The child that may reach farthest is pushed last, so that it is visited first.
  void visit_node(const WideNode& node) {
    const float* const x = node.planes[direction_.x > 0 ? 1 : 0];
    const float* const y = node.planes[direction_.y > 0 ? 3 : 2];
    const float* const z = node.planes[direction_.z > 0 ? 5 : 4];
    const std::size_t first = waiting_.size();
    const Eight bounds = along_direction(x, y, z);
    for (std::uint32_t left = bounds.farther; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(left));
      waiting_.push_back({bounds.reaches[lane], node.child[lane]});
      if (waiting_[first].bound < waiting_.back().bound) std::swap(waiting_[first], waiting_.back());
    }
    if (waiting_.size() > first) std::swap(waiting_[first], waiting_.back());
  }

  void visit_leaf(std::uint32_t leaf) {
    with_kind(mesh_.kind, [&](auto kind) { visit_leaf(kind, leaf); });
  }

  void visit_leaf(TriangleTraits, std::uint32_t leaf) {
    const auto& [x, y, z] = tree_.blocks[leaf].vertices;
    const Eight points = along_direction(x, y, z);
    for (std::uint32_t left = points.farther; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(left));
      if (points.reaches[lane] > reach_) reach_ = points.reaches[lane], farthest_ = {{x[lane], y[lane], z[lane]}, 0.0f};
    }
  }

  template <class Kind>
  void visit_leaf(Kind kind, std::uint32_t leaf) {
    for (const std::uint32_t primitive : leaves_of(kind, tree_)[leaf].primitives) {
      visit_ball(Kind::first(mesh_, primitive));
      if constexpr (Kind::kBalls > 1) visit_ball(Kind::last(mesh_, primitive));
    }
  }

  void visit_ball(const Ball& ball) {
    const Ball scaled{ball.centre * tree_.scale, ball.radius * tree_.scale};
    const float reach = reach_of(scaled);
    if (reach > reach_) reach_ = reach, farthest_ = scaled;
  }

  [[nodiscard]] float reach_of(const Ball& ball) const noexcept {
    return dot(direction_, ball.centre) + (ball.radius > 0 ? ball.radius * length(direction_) : 0.0f);
  }

  const WideBvh& tree_;
  const Mesh& mesh_;
  Vec3f direction_{0, 0, 0};
  Ball farthest_{{0, 0, 0}, 0};
  float reach_ = 0;
  std::vector<Waiting> waiting_;
};

}  // namespace

SupportTable::SupportTable(const WideBvh& tree, const Mesh& mesh) : unit_(1.0 / static_cast<double>(tree.scale)) {
  Search forward(tree, mesh), backward(tree, mesh);
  const auto place = [](int cell) { return static_cast<float>(cell) * (2.0f / kCells) - 1.0f; };
  for (int axis = 0; axis < 3; ++axis) {
    for (int row = 0; row <= kCells; ++row) {
      for (int step = 0; step <= kCells; ++step) {
        const int column = row % 2 == 0 ? step : kCells - step;  // back and forth: the next direction is near
        Vec3f direction{0, 0, 0};
        direction[axis] = 1.0f;
        direction[(axis + 1) % 3] = place(row);
        direction[(axis + 2) % 3] = place(column);
        samples_[axis][row][column] = {forward.farthest(direction), backward.farthest(-direction)};
      }
    }
  }
}

// The row may have any size.
RowRange SupportTable::along(Vec3d row) const noexcept {
  const double size[3] = {std::abs(row.x), std::abs(row.y), std::abs(row.z)};
  const int longer = size[1] > size[0] ? 1 : 0;
  const int axis = size[2] > size[longer] ? 2 : longer;
  if (!(size[axis] > 0)) return {0, 0};
  const double scale = 1.0 / row[axis];
  const auto cell_of = [&](int other) { return static_cast<float>((row[other] * scale + 1.0) * (kCells / 2)); };
  const float u = cell_of((axis + 1) % 3), v = cell_of((axis + 2) % 3);
  const int i = std::clamp(static_cast<int>(u), 0, kCells - 1), j = std::clamp(static_cast<int>(v), 0, kCells - 1);
  const float right = u - static_cast<float>(i), up = v - static_cast<float>(j);
  const Sample *const low = &samples_[axis][i][j], *const high = &samples_[axis][i + 1][j];
  const auto between = [&](float Sample::* side) {
    const float at_low = low[0].*side + (high[0].*side - low[0].*side) * right;
    const float at_high = low[1].*side + (high[1].*side - low[1].*side) * right;
    return static_cast<double>(at_low + (at_high - at_low) * up) * (size[axis] * unit_);
  };
  const double forward = between(&Sample::forward), backward = between(&Sample::backward);
  return row[axis] > 0 ? RowRange{-backward, forward} : RowRange{-forward, backward};
}

// Computes the three rows at once and without branches: if instances are turned at random, the face and the side cannot
// be predicted. The lanes are the rows; the last one is unused.
bool SupportTable::along_ordinary_rows(const Affine& map, RowRange* ranges) const noexcept {
  const auto lanes = [](Vec3d v, float idle) {
    return Float4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), idle);
  };
  const auto size_of = [](Float4 a) { return from_bits(bits_of(a) & Int4(0x7FFFFFFF)); };
  const auto pick = [](Int4 mask, Float4 a, Float4 b) {
    return from_bits(bits_of(b) ^ ((bits_of(a) ^ bits_of(b)) & mask));
  };
  const Float4 x = lanes(map.x, 1.0f), y = lanes(map.y, 0.0f), z = lanes(map.z, 0.0f);
  const Float4 size_xy = max(size_of(x), size_of(y)), size = max(size_xy, size_of(z));
  alignas(16) std::array<float, 4> sizes;
  size.store(sizes.data());
  for (const float one : sizes) {
    if (!(one > 1e-30f && one < 1e30f)) return false;
  }
  const Int4 is_y = less(size_of(x), size_of(y)), is_z = less(size_xy, size_of(z));
  const Float4 longest = pick(is_z, z, pick(is_y, y, x));
  const Float4 next = pick(is_z, x, pick(is_y, z, y)), last = pick(is_z, y, pick(is_y, x, z));
  const Float4 scale = Float4(1.0f) / longest, half(static_cast<float>(kCells / 2));
  const Float4 u = (next * scale + Float4(1.0f)) * half, v = (last * scale + Float4(1.0f)) * half;
  const Float4 last_cell(static_cast<float>(kCells - 1));
  const Int4 i = truncate(min(u, last_cell)), j = truncate(min(v, last_cell));
  alignas(16) std::array<std::int32_t, 4> axes, rows, columns;
  pick_axis(is_y, is_z).store(axes.data()), i.store(rows.data()), j.store(columns.data());
  alignas(16) std::array<float, 4> right;
  (u - to_float(i)).store(right.data());
  Float4 corners[4];  // of a row's cell: forward and backward at its lower side, and at its upper one
  for (std::size_t row = 0; row < 4; ++row) {
    const auto* const line = &samples_[axes[row]][rows[row]];
    const Float4 low = Float4::load_unaligned(&line[0][columns[row]]);
    const Float4 high = Float4::load_unaligned(&line[1][columns[row]]);
    corners[row] = low + (high - low) * Float4(right[row]);
  }
  transpose(corners[0], corners[1], corners[2], corners[3]);
  const Float4 up = v - to_float(j);
  const Float4 forward = corners[0] + (corners[2] - corners[0]) * up;
  const Float4 backward = corners[1] + (corners[3] - corners[1]) * up;
  const Int4 is_forward = less(Float4(0.0f), longest);
  alignas(16) std::array<float, 4> greatest, least;
  pick(is_forward, forward, backward).store(greatest.data()), pick(is_forward, backward, forward).store(least.data());
  for (std::size_t row = 0; row < 3; ++row) {
    const double unit = static_cast<double>(sizes[row]) * unit_;
    ranges[row] = {-static_cast<double>(least[row]) * unit, static_cast<double>(greatest[row]) * unit};
  }
  return true;
}

Aabb transformed_bounds(const SupportTable& support, double reach, const Affine& map) {
  RowRange ranges[3];
  if (!support.along_ordinary_rows(map, ranges)) {
    for (int axis = 0; axis < 3; ++axis) ranges[axis] = support.along({map.x[axis], map.y[axis], map.z[axis]});
  }
  return box_of_ranges(ranges, reach, map);
}

// World box -----------------------------------------------------------------------------------------------------------

namespace {

constexpr Vec3d row_of(const Affine& map, int axis) noexcept { return {map.x[axis], map.y[axis], map.z[axis]}; }

// Ranges are offset by `origin`.
RowRange range_along(Vec3d row, const Aabb& box, double origin = 0) noexcept {
  RowRange range{origin, origin};
  for_each_axis([&](auto i) {
    const double lower = row[i] * static_cast<double>(box.lower[i]), upper = row[i] * static_cast<double>(box.upper[i]);
    range.least += std::min(lower, upper);
    range.greatest += std::max(lower, upper);
  });
  return range;
}

// Returns the box around the vertices under a map's linear part, in float: a nanosecond each.
Box4 turned_box(const AlignedVector<Vec3f>& positions, const Affine& map) noexcept {
  const auto column = [](Vec3d v) {
    return Float4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0.0f);
  };
  const Float4 x = column(map.x), y = column(map.y), z = column(map.z);
  Box4 box = Box4::empty();
  for (const Vec3f p : positions) box.grow(x * Float4(p.x) + y * Float4(p.y) + z * Float4(p.z));
  return box;
}

// The same for spheres: a sphere extends beyond its centre by its radius times the length of a row.
Box4 turned_box(const AlignedVector<Ball>& balls, const Affine& map) noexcept {
  const auto column = [](Vec3d v) {
    return Float4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), 0.0f);
  };
  const Float4 x = column(map.x), y = column(map.y), z = column(map.z);
  const Float4 lengths = column({length(row_of(map, 0)), length(row_of(map, 1)), length(row_of(map, 2))});
  Box4 box = Box4::empty();
  for (const Ball& ball : balls) {
    const Vec3f p = ball.centre;
    const Float4 centre = x * Float4(p.x) + y * Float4(p.y) + z * Float4(p.z), reach = lengths * Float4(ball.radius);
    box.grow({centre - reach, centre + reach});
  }
  return box;
}

// For smaller rows, float loses more than the margin covers.
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
    // Half a unit of float is added for either direction of rounding.
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
  const Box4 turned = with_kind(mesh.kind, [&](auto kind) { return turned_box(kind.vertices(mesh), map); });
  alignas(16) float lower[4], upper[4];
  turned.lower.store(lower), turned.upper.store(upper);
  RowRange ranges[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d row = row_of(map, axis);
    ranges[axis] = range_along(row, box);  // vertices that no triangle uses do not count
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
