#include "wide/collapse.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "wide/collapse_plan.h"
#include "wide/emit.h"
#include "wide/split_leaves.h"

namespace perfect_bvh {
namespace {

float magnitude_of(float lower, float upper) { return std::max(std::abs(lower), std::abs(upper)); }

// 1 for ordinary coordinates; otherwise what brings the largest into [1, 2).
float scale_of(const Aabb& box) {
  const float reach = std::max({magnitude_of(box.lower.x, box.upper.x), magnitude_of(box.lower.y, box.upper.y),
                                magnitude_of(box.lower.z, box.upper.z)});
  if (!(reach > 0.0f) || (reach >= 0x1p-20f && reach <= 0x1p20f)) return 1.0f;
  // The power must be a normal number itself.
  return std::ldexp(1.0f, std::clamp(-std::ilogb(reach), -126, 126));
}

WideBvh collapse(const Bvh2& given, const TriangleMesh* mesh, ThreadPool& pool, CancelToken& cancel) {
  WideBvh wide;
  if (given.empty()) return wide;
  const TriangleIndices* const triangles = mesh ? mesh->triangles.data() : nullptr;
  const Bvh2 split = split_leaves(given, triangles, pool, cancel);
  const Bvh2& tree = split.empty() ? given : split;
  const Aabb bounds = tree.bounds();
  wide.is_empty = false;
  wide.repeats_triangles = mesh != nullptr && (!given.refittable || given.prim_indices.size() > mesh->triangle_count());
  wide.scale = scale_of(bounds);
  for (int axis = 0; axis < 3; ++axis) {
    wide.extent.largest[axis] = magnitude_of(bounds.lower[axis], bounds.upper[axis]) * wide.scale;
  }
  wide.extent.reach = std::max({wide.extent.largest[0], wide.extent.largest[1], wide.extent.largest[2]});
  CollapseCosts costs;
  costs.scale = wide.scale;
  // Measured on three meshes: 3 to 11% fewer nodes, and visits to them as before. In a tree of few nodes each of them
  // is met by many rays.
  constexpr float kMemory = 10.0f;
  if (mesh != nullptr) costs.memory = std::min(kMemory, static_cast<float>(tree.prim_indices.size()) / 64.0f);
  const auto decisions = plan_collapse(tree, triangles, costs, pool, cancel);
  emit_wide(tree, mesh, decisions, wide, pool, cancel);
  return wide;
}

}  // namespace

WideBvh collapse_mesh(const Bvh2& tree, const TriangleMesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  return collapse(tree, &mesh, pool, cancel);
}

WideBvh collapse_top_level(const Bvh2& tree, ThreadPool& pool, CancelToken& cancel) {
  return collapse(tree, nullptr, pool, cancel);
}

}  // namespace perfect_bvh
