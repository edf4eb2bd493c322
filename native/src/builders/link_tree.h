// A tree whose nodes can be moved: children and parents are linked by number, boxes and heights are kept up to date.
// In: a Bvh2. Out: a Bvh2 over the same leaves, again in depth-first order.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"
#include "math/float4.h"

namespace perfect_bvh {

class LinkTree {
 public:
  using Id = std::uint32_t;
  static constexpr Id kRoot = 0;

  // The tree must have at least one interior node.
  LinkTree(const Bvh2& tree, CancelToken& cancel);
  [[nodiscard]] Bvh2 to_bvh2(const Bvh2& original, CancelToken& cancel) const;

  [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }
  [[nodiscard]] bool is_leaf(Id id) const noexcept { return nodes_[id].right == 0; }
  [[nodiscard]] Id left(Id id) const noexcept { return nodes_[id].left; }
  [[nodiscard]] Id right(Id id) const noexcept { return nodes_[id].right; }
  [[nodiscard]] Id parent(Id id) const noexcept { return parents_[id]; }
  [[nodiscard]] Id sibling(Id id) const noexcept {
    const Node& node = nodes_[parents_[id]];
    return node.left == id ? node.right : node.left;
  }
  // Scaled by a power of two so that no area overflows or underflows. The fourth lanes hold the links.
  [[nodiscard]] Box4 box(Id id) const noexcept { return Box4::load(&nodes_[id]); }
  [[nodiscard]] float area(Id id) const noexcept { return half_area(box(id).extent()); }

  // Removes `moving` and its parent, and puts that parent in the position of `target`, with both as its children.
  // `target` is not the root, not below `moving`, and not its sibling or parent; `moving` is neither the root nor its
  // child.
  void move(Id moving, Id target) noexcept;
  [[nodiscard]] bool is_below(Id id, Id ancestor) const noexcept;
  [[nodiscard]] std::uint32_t depth_of(Id id) const noexcept;
  [[nodiscard]] std::uint32_t height(Id id) const noexcept { return heights_[id]; }

 private:
  // A leaf has no right child; its left one is its number in the original tree.
  struct alignas(16) Node {
    Vec3f lower;
    Id left;
    Vec3f upper;
    Id right;
  };

  void copy_node(const Bvh2& tree, Id id, Float4 scale) noexcept;
  void link(Id parent, Id old_child, Id new_child) noexcept;
  void update(Id id) noexcept;
  void update_upwards(Id id) noexcept;

  AlignedVector<Node> nodes_;
  std::vector<Id> parents_;
  std::vector<std::uint32_t> heights_;  // levels below
};

// Combine -------------------------------------------------------------------------------------------------------------
// Joins trees from any builders under new nodes (lecture, "Combining").
// In: trees. Out: one tree over all of their primitives; the nodes of the parts keep their boxes.

struct TreePart {
  const Bvh2* tree;
  std::uint32_t prim_offset = 0;  // added to the numbers of its primitives
  std::uint32_t root = 0;         // the subtree below this node is used
};

// Returns a copy of `top` in which each leaf is replaced by a part, the one whose number is the leaf's only row. Parts
// must not be empty. Boxes of `top` are ignored: its nodes get the boxes of everything below them. Throws
// InvalidArgument if the result would be deeper than kMaxTreeDepth; Cancelled.
[[nodiscard]] Bvh2 graft(const Bvh2& top, std::span<const TreePart> parts, CancelToken& cancel);

// Joins two trees under a new root. `right_offset` is added to the numbers of the right tree's primitives. An empty
// tree adds nothing. Throws like graft().
[[nodiscard]] Bvh2 combine(const Bvh2& left, const Bvh2& right, std::uint32_t right_offset);

}  // namespace perfect_bvh
