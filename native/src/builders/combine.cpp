#include "builders/combine.h"

#include <algorithm>
#include <string>
#include <vector>

#include "builders/top_down.h"
#include "core/errors.h"
#include "core/steps.h"

namespace perfect_bvh {
namespace {

// A node to be copied: of a part, or of the top if there is none.
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
