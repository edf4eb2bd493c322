#include "blas/cover.h"

#include <algorithm>
#include <cmath>

#include "math/float4.h"
#include "wide/wide_boxes.h"

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

// Boxes still to be opened, or kept as they are. The one with the largest surface gains most from being opened. Ties go
// by number, so that the cover repeats.
class Opening {
 public:
  struct Candidate {
    Aabb box;
    std::uint32_t number;
    [[nodiscard]] bool operator<(const Candidate& other) const noexcept {
      const float area = box.half_area(), other_area = other.box.half_area();
      return area != other_area ? area < other_area : number > other.number;
    }
  };

  [[nodiscard]] bool empty() const noexcept { return open_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return open_.size() + kept_.size(); }  // of the cover as it stands
  [[nodiscard]] const std::vector<Aabb>& kept() const noexcept { return kept_; }
  void keep(const Aabb& box) { kept_.push_back(box); }

  void add(const Aabb& box, std::uint32_t number) {
    open_.push_back({box, number});
    std::push_heap(open_.begin(), open_.end());
  }
  [[nodiscard]] Candidate take_largest() {
    std::pop_heap(open_.begin(), open_.end());
    const Candidate candidate = open_.back();
    open_.pop_back();
    return candidate;
  }

 private:
  std::vector<Candidate> open_;
  std::vector<Aabb> kept_;
};

}  // namespace

std::vector<Aabb> cover_boxes(const Bvh2& tree, std::size_t limit) {
  if (tree.empty()) return {};
  Opening opening;
  opening.add(tree.nodes[0].box(), 0);
  while (!opening.empty()) {
    const auto [box, number] = opening.take_largest();
    const Bvh2Node& node = tree.nodes[number];
    if (node.is_leaf() || opening.size() + 2 > limit) {
      opening.keep(box);
      continue;
    }
    for (const std::uint32_t child : {node.first, node.first + 1}) opening.add(tree.nodes[child].box(), child);
  }
  return opening.kept();
}

std::vector<Aabb> cover_boxes(const WideBvh& tree, const TriangleMesh& mesh, std::size_t limit) {
  if (tree.is_empty) return {};
  Opening opening;
  const float to_mesh = 1.0f / tree.scale;
  const auto in_mesh = [to_mesh](const Aabb& box) { return Aabb{box.lower * to_mesh, box.upper * to_mesh}; };
  opening.add(in_mesh(bounds_of(tree, mesh)), tree.root);
  while (!opening.empty()) {
    const auto [box, child] = opening.take_largest();
    if (child >= kBlockChild || opening.size() + kWideWidth > limit) {
      opening.keep(box);
      continue;
    }
    const WideNode& node = tree.nodes[child];
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] != kNoChild) opening.add(in_mesh(child_box(node, lane)), node.child[lane]);
    }
  }
  return opening.kept();
}

std::vector<Aabb> cover_boxes(const TriangleMesh& mesh, std::size_t limit) {
  const std::size_t count = mesh.triangle_count(), run_count = std::min(limit, count);
  std::vector<Aabb> boxes(run_count);
  for (std::size_t run = 0; run < run_count; ++run) {
    const std::size_t end = count * (run + 1) / run_count;
    for (std::size_t i = count * run / run_count; i < end; ++i) boxes[run].grow(mesh.triangle_box(i));
  }
  return boxes;
}

Cover make_cover(const std::vector<Aabb>& boxes) {
  Cover cover;
  for (std::size_t first = 0; first < boxes.size(); first += 4) cover.groups.push_back(make_group(boxes, first));
  for (const Aabb& box : boxes) {
    cover.box.grow(box);
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

Aabb transformed_box(const Aabb& box, const Affine& map) {
  if (box.is_empty()) return {};
  Aabb result;
  const Vec3d lower = to_double(box.lower), upper = to_double(box.upper);
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d row{map.x[axis], map.y[axis], map.z[axis]};
    double least = map.translation[axis], greatest = least;
    for (int i = 0; i < 3; ++i) {
      least += std::min(row[i] * lower[i], row[i] * upper[i]);
      greatest += std::max(row[i] * lower[i], row[i] * upper[i]);
    }
    result.lower[axis] = static_cast<float>(least);
    result.upper[axis] = static_cast<float>(greatest);
  }
  return result;
}

}  // namespace perfect_bvh
