#include "builders/link_tree.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "builders/top_down.h"
#include "core/cancel.h"
#include "core/errors.h"
#include "math/float4.h"

namespace perfect_bvh {
namespace {

// Returns the power of two that brings the largest extent near 1.
[[nodiscard]] float unit_scale(const Aabb& bounds) noexcept {
  const Vec3f extent = bounds.upper * 0.5f - bounds.lower * 0.5f;
  const float largest = std::max({extent.x, extent.y, extent.z});
  return largest > 0.0f ? std::ldexp(1.0f, std::clamp(-std::ilogb(largest), -126, 126)) : 1.0f;
}

}  // namespace

LinkTree::LinkTree(const Bvh2& tree, CancelToken& cancel)
    : nodes_(tree.nodes.size()), parents_(tree.nodes.size()), heights_(tree.nodes.size()) {
  const Float4 scale(unit_scale(tree.bounds()));
  for_steps_back(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) copy_node(tree, static_cast<Id>(i), scale);
  });
}

// The node's children must be copied before.
void LinkTree::copy_node(const Bvh2& tree, Id id, Float4 scale) noexcept {
  const Bvh2Node& from = tree.nodes[id];
  Node& to = nodes_[id];
  const Box4 box = Box4::load(&from);
  (box.lower.xyz0() * scale).store(&to.lower);
  (box.upper.xyz0() * scale).store(&to.upper);
  if (from.is_leaf() || id == 1) {
    to.left = id, to.right = 0;
    return;
  }
  to.left = from.first, to.right = from.first + 1;
  parents_[to.left] = parents_[to.right] = id;
  heights_[id] = std::max(heights_[to.left], heights_[to.right]) + 1;
}

void LinkTree::move(Id moving, Id target) noexcept {
  const Id parent = parents_[moving];
  const Id grandparent = parents_[parent];
  link(grandparent, parent, sibling(moving));
  update_upwards(grandparent);

  link(parents_[target], target, parent);
  nodes_[parent].left = target;
  nodes_[parent].right = moving;
  parents_[target] = parents_[moving] = parent;
  update_upwards(parent);
}

bool LinkTree::is_below(Id id, Id ancestor) const noexcept {
  while (id != kRoot && id != ancestor) id = parents_[id];
  return id == ancestor;
}

std::uint32_t LinkTree::depth_of(Id id) const noexcept {
  std::uint32_t depth = 0;
  for (; id != kRoot; id = parents_[id]) ++depth;
  return depth;
}

void LinkTree::link(Id parent, Id old_child, Id new_child) noexcept {
  Node& node = nodes_[parent];
  (node.left == old_child ? node.left : node.right) = new_child;
  parents_[new_child] = parent;
}

void LinkTree::update(Id id) noexcept {
  Node& node = nodes_[id];
  Box4 both = box(node.left);
  both.grow(box(node.right));
  const Id left = node.left, right = node.right;
  both.lower.store(&node.lower);
  both.upper.store(&node.upper);
  node.left = left;
  node.right = right;
  heights_[id] = std::max(heights_[left], heights_[right]) + 1;
}

void LinkTree::update_upwards(Id id) noexcept {
  for (;; id = parents_[id]) {
    update(id);
    if (id == kRoot) return;
  }
}

Bvh2 LinkTree::to_bvh2(const Bvh2& original, CancelToken& cancel) const {
  Bvh2 tree;
  tree.refittable = original.refittable;
  tree.depth = heights_[kRoot];
  tree.nodes.resize(original.nodes.size());
  tree.prim_indices.resize(original.prim_indices.size());
  write_node(tree.nodes[1], Box4::empty(), 0, 0);
  struct Pending {
    Id from;
    std::uint32_t to;
  };
  std::vector<Pending> stack{{kRoot, 0}};
  std::uint32_t next_node = 2, next_row = 0;
  for (Steps steps(cancel); !stack.empty(); steps.step()) {
    const Pending now = stack.back();
    stack.pop_back();
    Bvh2Node& node = tree.nodes[now.to];
    if (is_leaf(now.from)) {
      node = original.nodes[left(now.from)];
      std::copy_n(original.prim_indices.begin() + node.first, node.count, tree.prim_indices.begin() + next_row);
      node.first = next_row;
      next_row += node.count;
      continue;
    }
    node.first = next_node;
    node.count = 0;
    stack.push_back({right(now.from), next_node + 1});
    stack.push_back({left(now.from), next_node});
    next_node += 2;
  }
  for_steps_back(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) {
      if (!tree.nodes[i].is_leaf() && i != 1) enclose_children(tree.nodes[i], &tree.nodes[tree.nodes[i].first]);
    }
  });
  return tree;
}

// Combine -------------------------------------------------------------------------------------------------------------

namespace {

// A node to be copied: from a part, or from the top if there is none.
struct Pending {
  const TreePart* part;
  std::uint32_t from, to, depth;
};

void copy_leaf(Bvh2& out, const Pending& now, Bvh2Node leaf) {
  const auto rows = now.part->tree->prim_indices.begin() + leaf.first;
  leaf.first = static_cast<std::uint32_t>(out.prim_indices.size());
  out.nodes[now.to] = leaf;
  for (std::uint32_t i = 0; i < leaf.count; ++i) out.prim_indices.push_back(rows[i] + now.part->prim_offset);
}

}  // namespace

Bvh2 graft(const Bvh2& top, std::span<const TreePart> parts, CancelToken& cancel) {
  Bvh2 out;
  if (top.empty()) return out;
  out.nodes.resize(2);
  write_node(out.nodes[1], Box4::empty(), 0, 0);
  out.refittable = top.refittable;
  std::vector<std::uint32_t> joints;  // nodes of `top` in the result, parents first
  std::vector<Pending> stack{{nullptr, 0, 0, 0}};
  for (Steps steps(cancel); !stack.empty(); steps.step()) {
    Pending now = stack.back();
    stack.pop_back();
    if (now.part == nullptr && top.nodes[now.from].is_leaf()) {
      now.part = &parts[top.prim_indices[top.nodes[now.from].first]];
      now.from = now.part->root;
      out.refittable = out.refittable && now.part->tree->refittable;
    }
    Bvh2Node node = now.part != nullptr ? now.part->tree->nodes[now.from] : top.nodes[now.from];
    out.depth = std::max(out.depth, now.depth);
    if (node.is_leaf()) {
      copy_leaf(out, now, node);
      continue;
    }
    const auto first = static_cast<std::uint32_t>(out.nodes.size());
    out.nodes.resize(first + 2);
    if (now.part == nullptr) joints.push_back(now.to);
    stack.push_back({now.part, node.first + 1, first + 1, now.depth + 1});
    stack.push_back({now.part, node.first, first, now.depth + 1});
    node.first = first;
    out.nodes[now.to] = node;
  }
  if (out.depth > kMaxTreeDepth) {
    throw InvalidArgument("graft: the trees together would be " + std::to_string(out.depth) + " levels deep, at most " +
                          std::to_string(kMaxTreeDepth) + " are possible");
  }
  for (auto node = joints.rbegin(); node != joints.rend(); ++node) {
    enclose_children(out.nodes[*node], &out.nodes[out.nodes[*node].first]);
  }
  if (out.nodes.size() == 2) out.nodes.resize(1);  // a single leaf needs no padding
  return out;
}

Bvh2 combine(const Bvh2& left, const Bvh2& right, std::uint32_t right_offset) {
  const TreePart parts[2] = {{&left, 0}, {&right, right_offset}};
  Bvh2 top;
  for (std::uint32_t i = 0; i < 2; ++i) {
    if (!parts[i].tree->empty()) top.prim_indices.push_back(i);
  }
  if (top.prim_indices.empty()) return {};
  top.nodes.resize(top.prim_indices.size() == 2 ? 4 : 1);
  if (top.prim_indices.size() == 2) {
    write_node(top.nodes[0], Box4::empty(), 2, 0);
    write_node(top.nodes[2], Box4::empty(), 0, 1);
    write_node(top.nodes[3], Box4::empty(), 1, 1);
  } else {
    write_node(top.nodes[0], Box4::empty(), 0, 1);
  }
  CancelToken never;
  return graft(top, parts, never);
}

}  // namespace perfect_bvh
