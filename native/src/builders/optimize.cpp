#include "builders/optimize.h"

#include <algorithm>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "builders/link_tree.h"
#include "builders/top_down.h"
#include "core/cancel.h"

namespace perfect_bvh {
namespace {

using Id = LinkTree::Id;

// The share of all nodes, the largest ones, that the first pass tries; each later pass tries twice as many.
constexpr double kFirstShare = 0.05;
constexpr std::size_t kSearchGrain = 256;

struct Reinsertion {
  float gain = 0.0f;  // the reduction of the sum of all interior nodes' areas
  Id moving = 0;
  Id target = 0;
};

[[nodiscard]] float joint_area(Box4 a, const Box4& b) noexcept {
  a.grow(b);
  return half_area(a.extent());
}

// Climbs from a removed node, ancestor by ancestor. At each, the node may be inserted into the subtree on the other
// side; `saved` is the area by which the nodes on the path are smaller without it. It may also become the sibling of
// the ancestor itself, under a new node as large as that one was: `saved_above`.
class Climb {
 public:
  Climb(const LinkTree& tree, Id moving) noexcept
      : tree_(tree),
        below_(tree.parent(moving)),
        rest_(tree.box(tree.sibling(moving))),
        saved_(tree.area(below_)) {}  // the parent is removed entirely

  [[nodiscard]] bool at_end() const noexcept { return below_ == LinkTree::kRoot; }
  [[nodiscard]] Id ancestor() const noexcept { return below_; }
  [[nodiscard]] Id other_side() const noexcept { return tree_.sibling(below_); }
  [[nodiscard]] float saved() const noexcept { return saved_; }
  [[nodiscard]] float saved_above() const noexcept { return saved_ - tree_.area(below_); }
  void go_up() noexcept {
    rest_.grow(tree_.box(other_side()));
    below_ = tree_.parent(below_);
    saved_ += tree_.area(below_) - half_area(rest_.extent());
  }

 private:
  const LinkTree& tree_;
  Id below_;
  Box4 rest_;  // of below_, without the node
  float saved_;
};

// Searches the best new position of one node after another, with a stack that is reused.
class Search {
 public:
  explicit Search(const LinkTree& tree) : tree_(tree) {}

  [[nodiscard]] Reinsertion run(Id moving) {
    best_ = {0.0f, moving, 0};
    box_ = tree_.box(moving);
    area_ = half_area(box_.extent());
    for (Climb climb(tree_, moving); !climb.at_end(); climb.go_up()) {
      if (climb.ancestor() != tree_.parent(moving)) offer(climb.ancestor(), climb.saved_above());
      search_below(climb.other_side(), climb.saved());
    }
    return best_;
  }

 private:
  struct Entry {
    Id id;
    float left_over;  // of the savings, after enlarging the nodes above
  };

  // No position below an entry can gain more than left_over - area_: the new parent is at least as large as the node.
  void search_below(Id top, float saved) {
    push(top, saved);
    while (!stack_.empty()) {
      const Entry entry = stack_.back();
      stack_.pop_back();
      if (!(entry.left_over - area_ > best_.gain)) continue;
      const float joint = joint_area(tree_.box(entry.id), box_);
      offer(entry.id, entry.left_over - joint);
      if (tree_.is_leaf(entry.id)) continue;
      const float left_over = entry.left_over - (joint - tree_.area(entry.id));
      push(tree_.left(entry.id), left_over);
      push(tree_.right(entry.id), left_over);
    }
  }
  void offer(Id target, float gain) noexcept {
    if (!(gain > best_.gain)) return;
    best_.gain = gain;
    best_.target = target;
  }
  void push(Id id, float left_over) {
    if (left_over - area_ > best_.gain) stack_.push_back({id, left_over});
  }

  const LinkTree& tree_;
  std::vector<Entry> stack_;
  Box4 box_;
  float area_ = 0;
  Reinsertion best_;
};

class Optimizer {
 public:
  Optimizer(const Bvh2& tree, CancelToken& cancel) : tree_(tree, cancel), is_settled_(tree_.size(), 0) {}

  [[nodiscard]] const LinkTree& tree() const noexcept { return tree_; }

  // Returns the number of nodes moved.
  std::size_t run_pass(double share, ThreadPool& pool, CancelToken& cancel) {
    select(share, cancel);
    found_.resize(candidates_.size());
    for_chunks(pool, candidates_.size(), kSearchGrain, cancel, [&](std::size_t begin, std::size_t end) {
      Search search(tree_);
      for (std::size_t i = begin; i < end; ++i) found_[i] = search.run(candidates_[i].second);
    });
    sort_gains(cancel);
    std::size_t moved = 0;
    for_steps(found_.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) moved += apply(found_[i]);
    });
    return moved;
  }

 private:
  // Selects the largest nodes, except those that found no better position last time and whose surroundings did not
  // change.
  void select(double share, CancelToken& cancel) {
    candidates_.clear();
    candidates_.reserve(tree_.size());
    for_steps(tree_.size() - kFirstId, cancel, [&](std::size_t begin, std::size_t end) {
      for (auto id = static_cast<Id>(kFirstId + begin); id < kFirstId + end; ++id) {
        if (tree_.parent(id) != LinkTree::kRoot) candidates_.emplace_back(-tree_.area(id), id);
      }
    });
    const auto count = static_cast<std::size_t>(std::min(1.0, share) * static_cast<double>(candidates_.size()));
    select_nth(std::span(candidates_), count, cancel, std::less<>());
    std::size_t kept = 0;
    for_steps(count, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (is_settled_[candidates_[i].second] == 0) candidates_[kept++] = candidates_[i];
      }
    });
    candidates_.resize(kept);
  }

  // Sorts by gain, the largest first. If there is no gain, nothing will move, and the order does not matter.
  void sort_gains(CancelToken& cancel) {
    std::size_t count = 0;
    for_steps(found_.size(), cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (found_[i].gain > 0.0f) std::swap(found_[count++], found_[i]);
      }
    });
    Steps steps(cancel);
    const auto end = found_.begin() + static_cast<std::ptrdiff_t>(count);
    std::sort(found_.begin(), end, [&](const Reinsertion& a, const Reinsertion& b) {
      steps.step();
      return a.gain != b.gain ? a.gain > b.gain : a.moving < b.moving;
    });
  }

  // Moves a node. Earlier moves may have changed its gain: it is recomputed, and the move is only done if it still
  // gains.
  bool apply(const Reinsertion& found) noexcept {
    const Id moving = found.moving;
    if (!(found.gain > 0.0f)) {
      is_settled_[moving] = 1;
      return false;
    }
    const Id parent = tree_.parent(moving);
    if (parent == LinkTree::kRoot || found.target == parent || tree_.is_below(found.target, moving)) return false;
    // Gains as small as the rounding of the areas do not count.
    if (!(gain_now(found) > 1e-6f * tree_.area(parent))) return false;
    const std::uint32_t height = std::max(tree_.height(moving), tree_.height(found.target));
    if (tree_.depth_of(found.target) + 1 + height > kMaxTreeDepth) return false;
    const Id old_sibling = tree_.sibling(moving);
    tree_.move(moving, found.target);
    unsettle(moving);
    unsettle(old_sibling);
    return true;
  }

  // Returns a negative gain if the target is not possible.
  [[nodiscard]] float gain_now(const Reinsertion& found) const noexcept {
    const Box4 box = tree_.box(found.moving);
    for (Climb climb(tree_, found.moving); !climb.at_end(); climb.go_up()) {
      if (found.target == climb.ancestor()) return climb.saved_above();
      const Id top = climb.other_side();
      if (!tree_.is_below(found.target, top)) continue;
      float gain = climb.saved() - joint_area(tree_.box(found.target), box);
      for (Id id = found.target; id != top;) {
        id = tree_.parent(id);
        gain -= joint_area(tree_.box(id), box) - tree_.area(id);
      }
      return gain;
    }
    return -1.0f;
  }

  // Marks nodes near a change to be tried again.
  void unsettle(Id id) noexcept {
    constexpr int kLevels = 6;
    is_settled_[id] = 0;
    for (int level = 0; level < kLevels && id != LinkTree::kRoot; ++level) {
      is_settled_[tree_.sibling(id)] = 0;
      id = tree_.parent(id);
      is_settled_[id] = 0;
    }
  }

  static constexpr std::size_t kFirstId = LinkTree::kRoot + 2;

  LinkTree tree_;
  std::vector<std::uint8_t> is_settled_;
  std::vector<std::pair<float, Id>> candidates_;  // minus the area, node
  std::vector<Reinsertion> found_;
};

}  // namespace

OptimizeReport optimize_bvh2(Bvh2& tree, std::uint32_t most_passes, ThreadPool& pool, CancelToken& cancel) {
  OptimizeReport report;
  if (tree.depth < 2) return report;  // no node can move
  Optimizer optimizer(tree, cancel);
  double share = kFirstShare;
  while (report.passes < most_passes) {
    const std::size_t moved = optimizer.run_pass(share, pool, cancel);
    ++report.passes;
    report.moved += moved;
    if (moved == 0 && share >= 1.0) break;
    share = std::min(1.0, 2 * share);
  }
  if (report.moved > 0) tree = optimizer.tree().to_bvh2(tree, cancel);
  return report;
}

}  // namespace perfect_bvh
