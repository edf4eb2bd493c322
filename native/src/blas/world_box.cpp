#include "blas/world_box.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <vector>

#include "math/float4.h"
#include "math/vec3.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

// Returns 0, 1 or 2 in each lane.
Int4 pick_axis(Int4 is_y, Int4 is_z) noexcept { return (is_z & Int4(2)) | ((is_y & (is_z ^ Int4(-1))) & Int4(1)); }

// Finds the vertex or sphere of a tree that is farthest along a direction. Each search starts with the results of the
// last one and of the last in its column, and with the leaf below the boxes that reach farthest. Hardly any other leaf
// reaches farther, so the others are listed without a branch for each: processors would mispredict most of them.
class Search {
 public:
  Search(const WideBvh& tree, const Mesh& mesh) : tree_(tree), mesh_(mesh), nodes_(kRoom), leaves_(kRoom) {
    static_cast<void>(search({1, 0, 0}, -Aabb::kInfinity));
    columns_.fill(farthest_);
  }

  [[nodiscard]] float farthest(Vec3f direction, std::size_t column) {
    const float reach = farther_of(columns_[column], direction, reach_of(farthest_, direction));
    const float result = search(direction, reach);
    columns_[column] = farthest_;
    return result;
  }

 private:
  // The reaches of eight points, or of eight boxes by their farthest corners. Empty boxes reach minus infinity or NaN.
  class Eight {
   public:
    Eight(const float* x, const float* y, const float* z, Vec3f direction) noexcept {
      const Float4 dx(direction.x), dy(direction.y), dz(direction.z);
      for (std::size_t i : {0, 1}) {
        reaches_[i] = dx * Float4::load(x + 4 * i) + dy * Float4::load(y + 4 * i) + dz * Float4::load(z + 4 * i);
      }
    }
    Eight(const WideNode& node, Vec3f direction) noexcept
        : Eight(node.planes[direction.x > 0 ? 1 : 0], node.planes[direction.y > 0 ? 3 : 2],
                node.planes[direction.z > 0 ? 5 : 4], direction) {}

    // Returns a bit for each that is farther.
    [[nodiscard]] std::uint32_t farther_than(float reach) const noexcept {
      const auto lanes = [&](Float4 four) { return equal_lanes(less(Float4(reach), four), Int4(-1)); };
      return lanes(reaches_[0]) | lanes(reaches_[1]) << 4;
    }
    [[nodiscard]] std::size_t farthest() const noexcept {
      alignas(16) std::array<float, kWideWidth> all;
      reaches_[0].store(&all[0]), reaches_[1].store(&all[4]);
      std::size_t best = 0;
      for (std::size_t i = 1; i < kWideWidth; ++i) best = all[i] > all[best] ? i : best;
      return best;
    }

   private:
    Float4 reaches_[2];
  };

  [[nodiscard]] float search(Vec3f direction, float reach) {
    return with_kind(mesh_.kind, [&](auto kind) {
      std::uint32_t child = tree_.root;
      while (child < kBlockChild) child = tree_.nodes[child].child[Eight(tree_.nodes[child], direction).farthest()];
      reach = visit_leaf(kind, child - kBlockChild, direction, reach);
      for (const std::uint32_t leaf : leaves_beyond(direction, reach)) {
        reach = visit_leaf(kind, leaf - kBlockChild, direction, reach);
      }
      return reach;
    });
  }

  [[nodiscard]] std::span<const std::uint32_t> leaves_beyond(Vec3f direction, float reach) {
    std::size_t node_count = 0, leaf_count = 0;
    if (tree_.root < kBlockChild) nodes_[node_count++] = tree_.root;
    for (std::size_t i = 0; i < node_count; ++i) {
      const WideNode& node = tree_.nodes[nodes_[i]];
      const std::uint32_t farther = Eight(node, direction).farther_than(reach);
      for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
        const std::uint32_t child = node.child[lane], is_leaf = child / kBlockChild, is_farther = farther >> lane & 1;
        nodes_[node_count] = leaves_[leaf_count] = child;
        leaf_count += is_farther & is_leaf, node_count += is_farther & ~is_leaf;
      }
      const std::size_t most = std::max(node_count, leaf_count) + kWideWidth;
      if (most > nodes_.size()) nodes_.resize(2 * most), leaves_.resize(2 * most);
    }
    return {leaves_.data(), leaf_count};
  }

  // Returns the larger reach.
  [[nodiscard]] float visit_leaf(TriangleTraits, std::uint32_t leaf, Vec3f direction, float reach) {
    const auto& [x, y, z] = tree_.blocks[leaf].vertices;
    std::uint32_t left = Eight(x, y, z, direction).farther_than(reach);
    for (; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(left));
      reach = farther_of({{x[lane], y[lane], z[lane]}, 0.0f}, direction, reach);
    }
    return reach;
  }

  template <class Kind>
  [[nodiscard]] float visit_leaf(Kind kind, std::uint32_t leaf, Vec3f direction, float reach) {
    const auto scaled = [&](const Ball& ball) { return Ball{ball.centre * tree_.scale, ball.radius * tree_.scale}; };
    for (const std::uint32_t primitive : leaves_of(kind, tree_)[leaf].primitives) {
      reach = farther_of(scaled(Kind::first(mesh_, primitive)), direction, reach);
      if constexpr (Kind::kBalls > 1) reach = farther_of(scaled(Kind::last(mesh_, primitive)), direction, reach);
    }
    return reach;
  }

  [[nodiscard]] float farther_of(const Ball& ball, Vec3f direction, float reach) noexcept {
    const float its = reach_of(ball, direction);
    if (!(its > reach)) return reach;
    farthest_ = ball;
    return its;
  }

  [[nodiscard]] static float reach_of(const Ball& ball, Vec3f direction) noexcept {
    return dot(direction, ball.centre) + (ball.radius > 0 ? ball.radius * length(direction) : 0.0f);
  }

  const WideBvh& tree_;
  const Mesh& mesh_;
  Ball farthest_{{0, 0, 0}, 0};
  std::array<Ball, 16> columns_;  // where the last search in each column ended
  static constexpr std::size_t kRoom = 1024;
  std::vector<std::uint32_t> nodes_, leaves_;  // lists, with room for a node's children after their ends
};

}  // namespace

SupportTable::SupportTable(const WideBvh& tree, const Mesh& mesh) : unit_(1.0 / static_cast<double>(tree.scale)) {
  Search forward(tree, mesh), backward(tree, mesh);
  const auto place = [](int cell) { return static_cast<float>(cell) * (2.0f / kCells) - 1.0f; };
  const auto cell_of = [](float at) { return static_cast<int>((at + 1.0f) * (kCells / 2)); };
  const auto sample = [&](int axis, Vec3f direction, std::size_t column) -> Sample {
    for (int other = 0; other < axis; ++other) {  // edges belong to two faces
      if (std::abs(direction[other]) != 1.0f) continue;
      const Vec3f same = direction * direction[other];
      const Sample& known = samples_[other][cell_of(same[(other + 1) % 3])][cell_of(same[(other + 2) % 3])];
      return direction[other] > 0 ? known : Sample{known.backward, known.forward};
    }
    return {forward.farthest(direction, column), backward.farthest(-direction, column)};
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (int row = 0; row <= kCells; ++row) {
      for (int step = 0; step <= kCells; ++step) {
        const int column = row % 2 == 0 ? step : kCells - step;  // back and forth: the next direction is near
        Vec3f direction{0, 0, 0};
        direction[axis] = 1.0f;
        direction[(axis + 1) % 3] = place(row);
        direction[(axis + 2) % 3] = place(column);
        samples_[axis][row][column] = sample(axis, direction, static_cast<std::size_t>(column));
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
