#include "update/partial_rebuild.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "build/top_down.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

std::vector<PrimRef> refs_below(const Bvh2& tree, std::uint32_t node, std::span<const Aabb> prim_boxes) {
  std::vector<PrimRef> refs;
  std::vector<std::uint32_t> pending{node};
  while (!pending.empty()) {
    const Bvh2Node& now = tree.nodes[pending.back()];
    pending.pop_back();
    if (!now.is_leaf()) pending.insert(pending.end(), {now.first + 1, now.first});
    for (std::uint32_t i = 0; i < now.count; ++i) {
      const std::uint32_t prim = tree.prim_indices[now.first + i];
      refs.push_back({prim_boxes[prim].lower, prim, prim_boxes[prim].upper, 0});
    }
  }
  return refs;
}

struct Pending {
  const Bvh2* from;
  std::uint32_t node, to, depth;
};

// A copy of `tree` in depth-first order with `part` in the place of `node`.
Bvh2 exchange(const Bvh2& tree, std::uint32_t node, const Bvh2& part) {
  Bvh2 out;
  out.nodes.resize(2);
  out.nodes.reserve(tree.nodes.size() + part.nodes.size());
  out.prim_indices.reserve(tree.prim_indices.size());
  write_node(out.nodes[1], Box4::empty(), 0, 0);
  std::vector<Pending> stack{{&tree, 0, 0, 0}};
  while (!stack.empty()) {
    Pending now = stack.back();
    stack.pop_back();
    if (now.from == &tree && now.node == node) now.from = &part, now.node = 0;
    Bvh2Node copy = now.from->nodes[now.node];
    out.depth = std::max(out.depth, now.depth);
    if (copy.is_leaf()) {
      const auto rows = now.from->prim_indices.begin() + copy.first;
      copy.first = static_cast<std::uint32_t>(out.prim_indices.size());
      out.prim_indices.insert(out.prim_indices.end(), rows, rows + copy.count);
    } else {
      const auto first = static_cast<std::uint32_t>(out.nodes.size());
      stack.push_back({now.from, copy.first + 1, first + 1, now.depth + 1});
      stack.push_back({now.from, copy.first, first, now.depth + 1});
      copy.first = first;
      out.nodes.resize(first + 2);
    }
    out.nodes[now.to] = copy;
  }
  if (out.nodes.size() == 2) out.nodes.resize(1);
  return out;
}

// The nodes above `node`, parents first; empty for the root and for what is no node.
std::vector<std::uint32_t> path_to(const Bvh2& tree, std::uint32_t node) {
  std::vector<std::uint32_t> path;
  for (std::uint32_t i = node; i-- > 0;) {  // a parent stands before its children
    const Bvh2Node& candidate = tree.nodes[i];
    if (candidate.is_leaf() || i == 1 || candidate.first != (node & ~1u)) continue;
    path.push_back(i);
    node = i;
  }
  std::reverse(path.begin(), path.end());
  return path;
}

}  // namespace

bool rebuild_below(Bvh2& tree, std::uint32_t node, std::span<const Aabb> prim_boxes, const BuildConfig& config,
                   ThreadPool& pool, CancelToken& cancel) {
  if (!tree.refittable) {
    throw InvalidArgument("rebuild_below: the tree's boxes are clipped (spatial splits), so it must be rebuilt whole");
  }
  if (node == 1 || node >= tree.nodes.size()) {
    throw InvalidArgument("rebuild_below: expected a node of the tree, got " + std::to_string(node));
  }
  const auto path = path_to(tree, node);
  const Bvh2 part = build_bvh2(refs_below(tree, node, prim_boxes), config, pool, cancel);
  if (!part.refittable || path.size() + part.depth > kMaxTreeDepth) return false;
  Bvh2 result = exchange(tree, node, part);
  // Follow the way down again: the indices have changed, the sides have not.
  std::vector<std::uint32_t> new_path;
  std::uint32_t now = 0;
  for (std::size_t level = 0; level < path.size(); ++level) {
    new_path.push_back(now);
    const std::uint32_t old_child = level + 1 < path.size() ? path[level + 1] : node;
    now = result.nodes[now].first + (old_child & 1u);
  }
  for (auto above = new_path.rbegin(); above != new_path.rend(); ++above) {
    enclose_children(result.nodes[*above], &result.nodes[result.nodes[*above].first]);
  }
  tree = std::move(result);
  return true;
}

}  // namespace perfect_bvh
