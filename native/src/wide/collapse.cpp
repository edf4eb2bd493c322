#include "wide/collapse.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/errors.h"
#include "wide/collapse_plan.h"
#include "wide/leaf_block.h"

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

// Lanes by how far along each octant's diagonal their boxes stand, the farthest first.
void set_orders(WideNode& node, std::uint32_t count) {
  float centre[3][8];
  for (int axis = 0; axis < 3; ++axis) {
    for (std::uint32_t lane = 0; lane < count; ++lane) {
      centre[axis][lane] = node.planes[2 * axis][lane] * 0.5f + node.planes[2 * axis + 1][lane] * 0.5f;
    }
  }
  for (std::uint32_t& order : node.order) order = 0;
  for (std::uint32_t octant = 0; octant < 8; ++octant) {
    float distance[8];
    std::uint32_t lanes[8];
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      lanes[lane] = lane;
      if (lane >= count) continue;
      const float x = octant & 1 ? -centre[0][lane] : centre[0][lane];
      const float y = octant & 2 ? -centre[1][lane] : centre[1][lane];
      const float z = octant & 4 ? -centre[2][lane] : centre[2][lane];
      distance[lane] = x + y + z;
    }
    std::stable_sort(lanes, lanes + count, [&](std::uint32_t a, std::uint32_t b) { return distance[a] > distance[b]; });
    for (std::uint32_t place = 0; place < 8; ++place) node.order[place] |= lanes[place] << (3 * octant);
  }
}

// Writes the wide tree as planned, depth first. No recursion: trees may be as deep as they like.
class Emitter {
 public:
  Emitter(const Bvh2& tree, const TriangleMesh* mesh, const std::vector<CollapseDecision>& decisions, WideBvh& wide)
      : tree_(tree), mesh_(mesh), decisions_(decisions), wide_(wide) {}

  void run(CancelToken& cancel) {
    wide_.root = emit(0, 1);
    constexpr std::size_t kLook = 4096;
    for (std::size_t steps = 0; !waiting_.empty(); ++steps) {
      if (steps % kLook == 0) cancel.throw_if_stopped();
      const Waiting next = waiting_.back();
      waiting_.pop_back();
      wide_.nodes[next.node].child[next.lane] = emit(next.binary, next.depth);
    }
  }

 private:
  struct Waiting {
    std::uint32_t binary, node, lane, depth;
  };

  std::uint32_t emit(std::uint32_t binary, std::uint32_t depth) {
    return decisions_[binary].is_leaf ? emit_leaf(binary) : emit_node(binary, depth);
  }

  // The subtree's binary nodes that become children when it is given `places`.
  void spread(std::uint32_t binary, std::uint32_t places) {
    const std::uint8_t left = places == 1 ? std::uint8_t{0} : decisions_[binary].share[places - 2];
    if (left == 0) {
      children_[child_count_++] = binary;
      return;
    }
    spread(tree_.nodes[binary].first, left);
    spread(tree_.nodes[binary].first + 1, places - left);
  }

  std::uint32_t emit_node(std::uint32_t binary, std::uint32_t depth) {
    const auto row = static_cast<std::uint32_t>(wide_.nodes.size());
    if (row >= kBlockChild) throw EngineError("the tree has more nodes than a child can refer to");
    wide_.depth = std::max(wide_.depth, depth);
    const std::uint32_t left = decisions_[binary].left_of_node;
    child_count_ = 0;
    spread(tree_.nodes[binary].first, left);
    spread(tree_.nodes[binary].first + 1, 8 - left);
    WideNode& node = wide_.nodes.emplace_back();
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const Aabb box = lane < child_count_ ? tree_.nodes[children_[lane]].box() : Aabb{};
      for (int axis = 0; axis < 3; ++axis) {
        node.planes[2 * axis][lane] = box.lower[axis] * wide_.scale;
        node.planes[2 * axis + 1][lane] = box.upper[axis] * wide_.scale;
      }
      node.child[lane] = kNoChild;
    }
    set_orders(node, child_count_);
    for (std::uint32_t lane = child_count_; lane-- > 0;) waiting_.push_back({children_[lane], row, lane, depth + 1});
    return row;
  }

  std::uint32_t emit_leaf(std::uint32_t binary) {
    if (mesh_ == nullptr) {
      const std::uint32_t instance = tree_.prim_indices[tree_.nodes[binary].first];
      if (instance >= kMostInstances) throw EngineError("the scene has more instances than a tree can refer to");
      return kInstanceChild + instance;
    }
    if (wide_.blocks.size() >= kMostBlocks) throw EngineError("the mesh has more leaves than a tree can refer to");
    LeafSet set;
    collect(binary, set);
    wide_.blocks.push_back(make_leaf_block(set, *mesh_, wide_.scale));
    return kBlockChild + static_cast<std::uint32_t>(wide_.blocks.size() - 1);
  }

  // A subtree that fits into a leaf is at most 7 levels deep.
  void collect(std::uint32_t binary, LeafSet& set) {
    const Bvh2Node& node = tree_.nodes[binary];
    if (!node.is_leaf()) {
      collect(node.first, set);
      collect(node.first + 1, set);
      return;
    }
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t primitive = tree_.prim_indices[node.first + i];
      static_cast<void>(set.add(primitive, mesh_->triangles[primitive]));  // planned, so it fits
    }
  }

  const Bvh2& tree_;
  const TriangleMesh* mesh_;
  const std::vector<CollapseDecision>& decisions_;
  WideBvh& wide_;
  std::vector<Waiting> waiting_;
  std::uint32_t children_[8];
  std::uint32_t child_count_ = 0;
};

WideBvh collapse(const Bvh2& given, const TriangleMesh* mesh, CancelToken& cancel) {
  WideBvh wide;
  if (given.empty()) return wide;
  const TriangleIndices* const triangles = mesh ? mesh->triangles.data() : nullptr;
  const Bvh2 split = split_leaves(given, triangles);
  const Bvh2& tree = split.empty() ? given : split;
  const Aabb bounds = tree.bounds();
  wide.is_empty = false;
  wide.scale = scale_of(bounds);
  for (int axis = 0; axis < 3; ++axis) {
    wide.extent.largest[axis] = magnitude_of(bounds.lower[axis], bounds.upper[axis]) * wide.scale;
  }
  wide.extent.reach = std::max({wide.extent.largest[0], wide.extent.largest[1], wide.extent.largest[2]});
  const std::vector<CollapseDecision> decisions = plan_collapse(tree, triangles, CollapseCosts{}, cancel);
  Emitter(tree, mesh, decisions, wide).run(cancel);
  return wide;
}

}  // namespace

WideBvh collapse_mesh(const Bvh2& tree, const TriangleMesh& mesh, ThreadPool&, CancelToken& cancel) {
  return collapse(tree, &mesh, cancel);
}

WideBvh collapse_top_level(const Bvh2& tree, CancelToken& cancel) { return collapse(tree, nullptr, cancel); }

}  // namespace perfect_bvh
