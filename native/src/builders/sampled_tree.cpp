#include "builders/sampled_tree.h"

#include <algorithm>
#include <cmath>

#include "core/steps.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kLeafGrain = 1024;

// By which a moment's boxes are multiplied so that the whole tree's has a half surface of 1, and no area over- or
// underflows. Where the whole has none its nodes have none either: nothing is to be gained at that moment.
float scale_to_unit_area(const double (&extent)[3]) noexcept {
  const double largest = std::max({extent[0], extent[1], extent[2]});
  if (!(largest > 0)) return 0.0f;
  const double x = extent[0] / largest, y = extent[1] / largest, z = extent[2] / largest;
  const double area = x * y + y * z + z * x;
  return static_cast<float>(std::min(1.0 / (largest * std::sqrt(std::max(area, 1e-6))), 1e30));
}

}  // namespace

SampledTree::SampledTree(const Bvh2& tree, const SampledBoxes& boxes, ThreadPool& pool, CancelToken& cancel)
    : links_(tree, cancel),
      fours_((boxes.sample_count() + 3) / 4),
      boxes_(tree.nodes.size() * fours_),
      areas_(tree.nodes.size()) {
  for_chunks(pool, size(), kLeafGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t id = begin; id < end; ++id) {
      if (tree.nodes[id].is_leaf()) gather_leaf(tree, boxes, static_cast<Id>(id));
    }
  });
  const std::size_t grain = kItemsBetweenAsking / fours_;
  for (std::size_t id = size(); id-- > 0;) {
    if (id % grain == 0) cancel.checkpoint();
    if (id != 1 && !is_leaf(static_cast<Id>(id))) enclose_children(static_cast<Id>(id));
  }
  make_comparable(boxes.sample_count(), pool, cancel);
}

void SampledTree::gather_leaf(const Bvh2& tree, const SampledBoxes& boxes, Id id) noexcept {
  const Bvh2Node& leaf = tree.nodes[id];
  const std::size_t sample_count = boxes.sample_count();
  for (std::size_t four = 0; four < fours_; ++four) {
    alignas(16) std::array<std::array<float, 4>, 6> planes{};  // without size where there is no moment
    for (std::size_t lane = 0; lane < 4 && 4 * four + lane < sample_count; ++lane) {
      Aabb box;
      for (std::uint32_t i = 0; i < leaf.count; ++i) {
        box.grow(boxes.box(4 * four + lane, tree.prim_indices[leaf.first + i]));
      }
      planes[0][lane] = box.lower.x, planes[1][lane] = box.lower.y, planes[2][lane] = box.lower.z;
      planes[3][lane] = box.upper.x, planes[4][lane] = box.upper.y, planes[5][lane] = box.upper.z;
    }
    FourBoxes& to = boxes_[id * fours_ + four];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to.lower[axis] = Float4::load(planes[axis].data()), to.upper[axis] = Float4::load(planes[3 + axis].data());
    }
  }
}

// Multiplying by one number keeps the order of any two, so that each box still is around its children's, exactly.
void SampledTree::make_comparable(std::size_t sample_count, ThreadPool& pool, CancelToken& cancel) {
  std::array<Float4, kMostFours> scales;
  for (std::size_t four = 0; four < fours_; ++four) {
    alignas(16) std::array<std::array<float, 4>, 6> planes;
    const FourBoxes& whole = boxes_[kRoot * fours_ + four];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      whole.lower[axis].store(planes[axis].data()), whole.upper[axis].store(planes[3 + axis].data());
    }
    alignas(16) std::array<float, 4> factors{};
    for (std::size_t lane = 0; lane < 4 && 4 * four + lane < sample_count; ++lane) {
      double extent[3];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        extent[axis] = static_cast<double>(planes[3 + axis][lane]) - static_cast<double>(planes[axis][lane]);
      }
      factors[lane] = scale_to_unit_area(extent);
    }
    scales[four] = Float4::load(factors.data());
  }
  for_chunks(pool, size(), kLeafGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t id = begin; id < end; ++id) {
      for (std::size_t four = 0; four < fours_; ++four) {
        FourBoxes& boxes = boxes_[id * fours_ + four];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          boxes.lower[axis] = boxes.lower[axis] * scales[four], boxes.upper[axis] = boxes.upper[axis] * scales[four];
        }
      }
      measure(static_cast<Id>(id));
    }
  });
}

void SampledTree::enclose_children(Id id) noexcept {
  FourBoxes* const own = &boxes_[id * fours_];
  const FourBoxes* const left_boxes = &boxes_[left(id) * fours_];
  const FourBoxes* const right_boxes = &boxes_[right(id) * fours_];
  for (std::size_t i = 0; i < fours_; ++i) {
    own[i] = left_boxes[i];
    own[i].grow(right_boxes[i]);
  }
}

void SampledTree::measure(Id id) noexcept { areas_[id] = area_of(Enclosure(enclosure(id))); }

void SampledTree::update_upwards(Id id) noexcept {
  for (;; id = parent(id)) {
    enclose_children(id);
    measure(id);
    if (id == kRoot) return;
  }
}

void SampledTree::move(Id moving, Id target) noexcept {
  const Id own_parent = parent(moving), grandparent = parent(own_parent);
  links_.move(moving, target);
  update_upwards(grandparent);  // it may stand elsewhere by now, and so may what is above it: both ways up are right
  update_upwards(own_parent);
}

}  // namespace perfect_bvh
