#include "scene/cover.h"

#include <algorithm>
#include <cmath>

#include "math/float4.h"

namespace perfect_bvh {
namespace {

CoverGroup make_group(const std::vector<Aabb>& boxes, std::size_t first) {
  CoverGroup group;
  for (std::size_t lane = 0; lane < 4; ++lane) {
    const Aabb& box = boxes[first + lane < boxes.size() ? first + lane : 0];
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = static_cast<double>(box.lower[axis]), upper = static_cast<double>(box.upper[axis]);
      const auto centre = static_cast<float>((lower + upper) * 0.5);
      group.centre[axis][lane] = centre;
      group.half[axis][lane] =
          round_up(std::max(upper - static_cast<double>(centre), static_cast<double>(centre) - lower));
    }
  }
  return group;
}

float least_of(Float4 v) {
  alignas(16) float lanes[4];
  v.store(lanes);
  return std::min(std::min(lanes[0], lanes[1]), std::min(lanes[2], lanes[3]));
}

float greatest_of(Float4 v) {
  alignas(16) float lanes[4];
  v.store(lanes);
  return std::max(std::max(lanes[0], lanes[1]), std::max(lanes[2], lanes[3]));
}

}  // namespace

std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit) {
  if (tree.empty()) return {};
  // The node with the largest surface gains most from being opened. Ties go by index, so that the cover repeats.
  struct Candidate {
    float area;
    std::uint32_t node;
    bool operator<(const Candidate& other) const { return area != other.area ? area < other.area : node > other.node; }
  };
  std::vector<Aabb> boxes;
  std::vector<Candidate> open{{tree.nodes[0].box().half_area(), 0}};
  while (!open.empty()) {
    std::pop_heap(open.begin(), open.end());
    const Bvh2Node& node = tree.nodes[open.back().node];
    open.pop_back();
    if (node.is_leaf() || boxes.size() + open.size() + 2 > limit) {
      boxes.push_back(node.box());
      continue;
    }
    for (const std::uint32_t child : {node.first, node.first + 1}) {
      open.push_back({tree.nodes[child].box().half_area(), child});
      std::push_heap(open.begin(), open.end());
    }
  }
  return boxes;
}

Cover make_cover(const Bvh2& tree, std::size_t limit) {
  const std::vector<Aabb> boxes = cover_boxes(tree, limit);
  Cover cover;
  for (std::size_t first = 0; first < boxes.size(); first += 4) cover.groups.push_back(make_group(boxes, first));
  for (const Aabb& box : boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      cover.reach = std::max({cover.reach, static_cast<double>(std::abs(box.lower[axis])),
                              static_cast<double>(std::abs(box.upper[axis]))});
    }
  }
  return cover;
}

// Centre and half side: the extent along a world axis is that of the box along the map's row for that axis. In float,
// about the instance's own place, which is added in double.
Aabb transformed_bounds(const Cover& cover, const Affine& map) {
  if (cover.groups.empty()) return {};
  Float4 entry[3][3], size[3][3], lower[3], upper[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3f row = to_float({map.x[axis], map.y[axis], map.z[axis]});
    for (int i = 0; i < 3; ++i) entry[axis][i] = Float4(row[i]), size[axis][i] = Float4(std::abs(row[i]));
    lower[axis] = Float4(Aabb::kInfinity), upper[axis] = Float4(-Aabb::kInfinity);
  }
  for (const CoverGroup& group : cover.groups) {
    for (int axis = 0; axis < 3; ++axis) {
      Float4 centre = entry[axis][0] * Float4::load(group.centre[0]),
             half = size[axis][0] * Float4::load(group.half[0]);
      for (int i = 1; i < 3; ++i) {
        centre = centre + entry[axis][i] * Float4::load(group.centre[i]);
        half = half + size[axis][i] * Float4::load(group.half[i]);
      }
      lower[axis] = min(centre - half, lower[axis]);
      upper[axis] = max(centre + half, upper[axis]);
    }
  }
  Aabb result;
  for (int axis = 0; axis < 3; ++axis) {
    set_range(result, axis, map.translation[axis], static_cast<double>(least_of(lower[axis])),
              static_cast<double>(greatest_of(upper[axis])), cover.reach, {map.x[axis], map.y[axis], map.z[axis]});
  }
  return result;
}

}  // namespace perfect_bvh
