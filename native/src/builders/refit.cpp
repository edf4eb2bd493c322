#include "builders/refit.h"

#include <string>

#include "core/errors.h"
#include "core/steps.h"
#include "math/float4.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kNodeGrain = 4096;

void require_refittable(const Bvh2& tree) {
  if (tree.refittable) return;
  throw InvalidArgument("refit_bvh2: the tree's boxes are clipped (spatial splits), so it must be rebuilt instead");
}

// A minimum of -0 and +0 may be either; adding +0 makes it +0 always.
[[nodiscard]] Vec3f positive_zeros(Vec3f v) noexcept { return v + Vec3f{0.0f, 0.0f, 0.0f}; }

void refit_leaf(const Bvh2& tree, std::span<const PrimRef> boxes, Bvh2Node& node) noexcept {
  Aabb box;
  for (std::uint32_t i = 0; i < node.count; ++i) box.grow(boxes[tree.prim_indices[node.first + i]].box());
  node.lower = positive_zeros(box.lower);
  node.upper = positive_zeros(box.upper);
}

void refit_interior(Bvh2Node& node, const Bvh2Node* children) noexcept {
  Box4 box = Box4::load(&children[0]);
  box.grow(Box4::load(&children[1]));
  const std::uint32_t first = node.first;
  box.lower.store(&node.lower);
  box.upper.store(&node.upper);
  node.first = first;
  node.count = 0;
}

// Node 1 is padding that looks like an interior node without children.
[[nodiscard]] bool is_padding(std::size_t index) noexcept { return index == 1; }

// From the last node to the first: no parent stands after its child.
void refit_interiors(Bvh2& tree, CancelToken& cancel) {
  for_steps_back(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) {
      Bvh2Node& node = tree.nodes[i];
      if (!node.is_leaf() && !is_padding(i)) refit_interior(node, &tree.nodes[node.first]);
    }
  });
}

}  // namespace

void refit_bvh2(Bvh2& tree, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  require_refittable(tree);
  // The leaves gather boxes from everywhere: worth sharing out. The rest is a short loop over what they left.
  for_chunks(pool, tree.nodes.size(), kNodeGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (tree.nodes[i].is_leaf()) refit_leaf(tree, boxes, tree.nodes[i]);
    }
  });
  refit_interiors(tree, cancel);
}

}  // namespace perfect_bvh
