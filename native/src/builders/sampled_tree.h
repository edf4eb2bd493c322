// A tree whose nodes have a box at each of several moments of an animation, and can be moved about: a node is as large
// as its boxes' surfaces are together, each as a share of the whole tree's at that moment. That sum is what a ray that
// meets the tree at any of the moments is expected to visit.
// In: a Bvh2, and where each of its primitives is at each moment. Out: a Bvh2 over the same leaves.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "builders/bvh2.h"
#include "builders/link_tree.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"
#include "math/float4.h"

namespace perfect_bvh {

// Where primitives are at each of several moments.
class SampledBoxes {
 public:
  virtual ~SampledBoxes() = default;

  static constexpr std::size_t kMost = 64;  // moments
  [[nodiscard]] virtual std::size_t sample_count() const noexcept = 0;
  // Called from many threads at once.
  [[nodiscard]] virtual Aabb box(std::size_t sample, std::uint32_t prim_index) const noexcept = 0;
};

// The boxes at four moments, side by side.
struct alignas(16) FourBoxes {
  Float4 lower[3];
  Float4 upper[3];

  [[nodiscard]] static FourBoxes empty() noexcept {
    const Float4 high(__builtin_inff()), low(-__builtin_inff());
    return {{high, high, high}, {low, low, low}};
  }
  void grow(const FourBoxes& other) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = min(other.lower[axis], lower[axis]), upper[axis] = max(other.upper[axis], upper[axis]);
    }
  }
  // Half the surface of each.
  [[nodiscard]] Float4 areas() const noexcept {
    const Float4 x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
    return x * y + (y * z + z * x);
  }
};

class SampledTree {
 public:
  using Id = LinkTree::Id;
  static constexpr Id kRoot = LinkTree::kRoot;
  struct EnclosureView {
    const FourBoxes* boxes = nullptr;
    std::size_t fours = 0;
  };
  class Enclosure;

  // The tree must have at least one interior node, and there are up to SampledBoxes::kMost moments.
  SampledTree(const Bvh2& tree, const SampledBoxes& boxes, ThreadPool& pool, CancelToken& cancel);
  [[nodiscard]] Bvh2 to_bvh2(const Bvh2& original, CancelToken& cancel) const {
    return links_.to_bvh2(original, cancel);
  }

  [[nodiscard]] std::size_t size() const noexcept { return links_.size(); }
  [[nodiscard]] bool is_leaf(Id id) const noexcept { return links_.is_leaf(id); }
  [[nodiscard]] Id left(Id id) const noexcept { return links_.left(id); }
  [[nodiscard]] Id right(Id id) const noexcept { return links_.right(id); }
  [[nodiscard]] Id parent(Id id) const noexcept { return links_.parent(id); }
  [[nodiscard]] Id sibling(Id id) const noexcept { return links_.sibling(id); }
  [[nodiscard]] bool is_below(Id id, Id ancestor) const noexcept { return links_.is_below(id, ancestor); }
  [[nodiscard]] std::uint32_t depth_of(Id id) const noexcept { return links_.depth_of(id); }
  [[nodiscard]] std::uint32_t height(Id id) const noexcept { return links_.height(id); }

  [[nodiscard]] EnclosureView enclosure(Id id) const noexcept { return {&boxes_[id * fours_], fours_}; }
  [[nodiscard]] float area(Id id) const noexcept { return areas_[id]; }
  [[nodiscard]] static float area_of(const Enclosure& enclosure) noexcept;
  [[nodiscard]] float joint_area(Id id, EnclosureView other) const noexcept {
    const FourBoxes* const own = &boxes_[id * fours_];
    Float4 sum(0.0f);
    for (std::size_t i = 0; i < fours_; ++i) {
      FourBoxes both = own[i];
      both.grow(other.boxes[i]);
      sum = sum + both.areas();
    }
    return sum_of(sum);
  }

  void move(Id moving, Id target) noexcept;  // see LinkTree

 private:
  static constexpr std::size_t kMostFours = SampledBoxes::kMost / 4;

  [[nodiscard]] static float sum_of(Float4 four) noexcept {
    alignas(16) std::array<float, 4> lanes;
    four.store(lanes.data());
    return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
  }
  void gather_leaf(const Bvh2& tree, const SampledBoxes& boxes, Id id) noexcept;
  void enclose_children(Id id) noexcept;
  void make_comparable(std::size_t sample_count, ThreadPool& pool, CancelToken& cancel);
  void measure(Id id) noexcept;
  void update_upwards(Id id) noexcept;

  LinkTree links_;
  std::size_t fours_;               // moments, divided by four
  AlignedVector<FourBoxes> boxes_;  // of each node, fours_ of them; places without a moment have no size
  std::vector<float> areas_;
};

// One of its own, that may grow.
class SampledTree::Enclosure {
 public:
  Enclosure(EnclosureView view) noexcept : fours_(view.fours) {
    for (std::size_t i = 0; i < fours_; ++i) boxes_[i] = view.boxes[i];
  }
  void grow(EnclosureView other) noexcept {
    for (std::size_t i = 0; i < fours_; ++i) boxes_[i].grow(other.boxes[i]);
  }
  [[nodiscard]] float area() const noexcept {
    Float4 sum(0.0f);
    for (std::size_t i = 0; i < fours_; ++i) sum = sum + boxes_[i].areas();
    return sum_of(sum);
  }

 private:
  std::size_t fours_ = 0;
  std::array<FourBoxes, kMostFours> boxes_;
};

inline float SampledTree::area_of(const Enclosure& enclosure) noexcept { return enclosure.area(); }

}  // namespace perfect_bvh
