#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "core/cancel.h"
#include "core/errors.h"
#include "math/float4.h"
#include "math/sorting_network.h"
#include "wide/collapse.h"
#include "wide/leaf_block.h"
#include "wide/small_set.h"

namespace perfect_bvh {
namespace {

using Octants = std::array<Float4, kWideWidth>;  // by child; lanes: the octants below
// Rays that run up all axes, and rays that run down one. 7 minus an octant is the opposite one.
constexpr std::array<int, 4> kOctants{0, 1, 2, 4};

// By number of children, then place: the place in the order of the opposite octant. Unused slots keep theirs.
constexpr auto kOpposite = [] {
  std::array<std::array<std::uint8_t, kWideWidth>, kWideWidth + 1> table{};
  for (std::uint8_t count = 0; count <= kWideWidth; ++count) {
    for (std::uint8_t place = 0; place < kWideWidth; ++place) {
      table[count][place] = static_cast<std::uint8_t>(place < count ? count - 1 - place : place);
    }
  }
  return table;
}();

// Returns how far the boxes are along the octants' diagonals. The lowest bits of each distance are the child's number.
// Unused slots are at the near end.
Octants distances(const WideNode& node, std::uint32_t count) noexcept {
  constexpr float kFar = std::numeric_limits<float>::max();
  static constexpr std::array<float, 2 * kWideWidth> kLimits{kFar,  kFar,  kFar,  kFar,  kFar,  kFar,  kFar,  kFar,
                                                             -kFar, -kFar, -kFar, -kFar, -kFar, -kFar, -kFar, -kFar};
  Octants distance;
  for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
    const auto centre = [&](int axis) {
      return Float4::load(&node.planes[2 * axis][first]) * Float4(0.5f) +
             Float4::load(&node.planes[2 * axis + 1][first]) * Float4(0.5f);
    };
    const Float4 x = centre(0), y = centre(1), z = centre(2);
    const Float4 limit = Float4::load_unaligned(&kLimits[kWideWidth - count + first]);  // the minimum of NaN, too
    const auto limited = [&](Float4 row) { return max(min(row, limit), Float4(-kFar)); };
    Float4 rows[4] = {limited((x + y) + z), limited((y - x) + z), limited((x - y) + z), limited((x + y) - z)};
    transpose(rows[0], rows[1], rows[2], rows[3]);
    for (std::uint32_t i = 0; i < 4; ++i) {
      distance[first + i] = tagged(rows[i], Int4(kWideWidth - 1), Int4(static_cast<std::int32_t>(first + i)));
    }
  }
  return distance;
}

// Puts the larger into a. Neither is lost, even if processors treat small values as zero.
void put_far_first(Float4& a, Float4& b) noexcept {
  const Float4 far = max(a, b);
  b = from_bits(bits_of(a) ^ bits_of(b) ^ bits_of(far));
  a = far;
}

}  // namespace

void set_visit_order(WideNode& node, std::uint32_t count) noexcept {
  Octants children = distances(node, count);
  sort_eight(children, put_far_first);
  alignas(16) std::array<std::uint32_t, kWideWidth> opposite;
  for (std::size_t first = 0; first < kWideWidth; first += 4) {
    Float4* const rows = &children[first];
    transpose(rows[0], rows[1], rows[2], rows[3]);
    Int4 order(0), reversed(0);
    for (std::size_t i = 0; i < kOctants.size(); ++i) {
      const Int4 child = bits_of(rows[i]) & Int4(kWideWidth - 1);
      order = order | child << (3 * kOctants[i]), reversed = reversed | child << (3 * (7 - kOctants[i]));
    }
    order.store(&node.order[first]), reversed.store(&opposite[first]);
  }
  for (std::size_t place = 0; place < kWideWidth; ++place) node.order[place] |= opposite[kOpposite[count][place]];
}

// Emit ----------------------------------------------------------------------------------------------------------------

namespace {

// Nodes of the binary tree, up to 8: the children of a wide node.
struct Children {
  std::array<SubtreeRange, kWideWidth> ranges;
  std::uint32_t count = 0;
};

struct Totals {
  std::size_t nodes = 0, leaves = 0;
  std::uint32_t depth = 0;
};

// Reads the plan from the top. Recursion is no deeper than a leaf, so trees may have any depth.
class Plan {
 public:
  Plan(const Bvh2& tree, std::span<const CollapseDecision> decisions) : tree_(tree), decisions_(decisions) {}

  [[nodiscard]] const Bvh2& tree() const noexcept { return tree_; }
  [[nodiscard]] bool is_leaf(std::uint32_t binary) const noexcept { return decisions_[binary].is_leaf; }

  [[nodiscard]] Children children_of(SubtreeRange range) const noexcept {
    Children children;
    const std::uint32_t to_left = decisions_[range.node].left_of_node;
    spread(left_range(tree_, range), to_left, children);
    spread(right_range(tree_, range), kWideWidth - to_left, children);
    return children;
  }

 private:
  // Lists the nodes that become children if the subtree gets `places` slots.
  void spread(SubtreeRange range, std::uint32_t places, Children& children) const noexcept {
    const std::uint32_t to_left = places == 1 ? 0 : decisions_[range.node].share[places - 2];
    if (to_left == 0) {
      children.ranges[children.count++] = range;
      return;
    }
    spread(left_range(tree_, range), to_left, children);
    spread(right_range(tree_, range), places - to_left, children);
  }

  const Bvh2& tree_;
  std::span<const CollapseDecision> decisions_;
};

// A subtree of the wide tree, or a single node of its upper levels.
struct Part {
  SubtreeRange range;
  std::uint32_t depth;   // of its root, from 1 on
  std::uint32_t parent;  // the part that holds its parent; the root's is 0
  std::uint32_t lane;    // of the parent node
  bool is_subtree;
  Totals totals;  // of its contents
  std::size_t first_node = 0, first_leaf = 0;
};

constexpr std::uint32_t kSubtreeSize = 8192;  // binary nodes below the root of one task

class Emitter {
 public:
  Emitter(const Plan& plan, const Mesh* mesh, WideBvh& wide)
      : plan_(plan), mesh_(mesh), triangles_(mesh != nullptr ? mesh->triangles.data() : nullptr), wide_(wide) {}

  // Counts the rows that a subtree will need.
  [[nodiscard]] Totals count(const Part& part) {
    Totals totals;
    waiting_.assign(1, {part.range, part.depth, 0, 0});
    while (!waiting_.empty()) {
      const Waiting now = waiting_.back();
      waiting_.pop_back();
      if (plan_.is_leaf(now.range.node)) {
        ++totals.leaves;
        continue;
      }
      ++totals.nodes;
      totals.depth = std::max(totals.depth, now.depth);
      const Children children = plan_.children_of(now.range);
      for (std::uint32_t lane = 0; lane < children.count; ++lane) {
        waiting_.push_back({children.ranges[lane], now.depth + 1, 0, lane});
      }
    }
    return totals;
  }

  void write(const Part& part) {
    next_node_ = static_cast<std::uint32_t>(part.first_node);
    next_leaf_ = static_cast<std::uint32_t>(part.first_leaf);
    if (!part.is_subtree) {
      static_cast<void>(write_node(plan_.children_of(part.range)));
      return;
    }
    waiting_.clear();
    static_cast<void>(write_child(part.range));
    while (!waiting_.empty()) {
      const Waiting now = waiting_.back();
      waiting_.pop_back();
      wide_.nodes[now.node].child[now.lane] = write_child(now.range);
    }
  }

  // Returns the child reference to a part's root.
  [[nodiscard]] std::uint32_t child_of(const Part& part) const {
    if (!plan_.is_leaf(part.range.node)) return static_cast<std::uint32_t>(part.first_node);
    if (mesh_ == nullptr) return instance_of(part.range.node);
    return kBlockChild + static_cast<std::uint32_t>(part.first_leaf);
  }

 private:
  struct Waiting {
    SubtreeRange range;
    std::uint32_t depth, node, lane;
  };

  [[nodiscard]] std::uint32_t instance_of(std::uint32_t binary) const {
    return kInstanceChild + plan_.tree().prim_indices[plan_.tree().nodes[binary].first];
  }

  std::uint32_t write_child(SubtreeRange range) {
    if (plan_.is_leaf(range.node)) return write_leaf(range.node);
    const Children children = plan_.children_of(range);
    const std::uint32_t row = write_node(children);
    for (std::uint32_t lane = children.count; lane-- > 0;) waiting_.push_back({children.ranges[lane], 0, row, lane});
    return row;
  }

  std::uint32_t write_node(const Children& children) {
    WideNode& node = wide_.nodes[next_node_];
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      const Aabb box = lane < children.count ? plan_.tree().nodes[children.ranges[lane].node].box() : Aabb{};
      for (int axis = 0; axis < 3; ++axis) {
        node.planes[2 * axis][lane] = box.lower[axis] * wide_.scale;
        node.planes[2 * axis + 1][lane] = box.upper[axis] * wide_.scale;
      }
      node.child[lane] = kNoChild;
    }
    set_visit_order(node, children.count);
    return next_node_++;
  }

  std::uint32_t write_leaf(std::uint32_t binary) {
    if (mesh_ == nullptr) return instance_of(binary);
    primitive_count_ = 0;
    collect(binary);
    with_kind(mesh_->kind, [&](auto kind) {
      leaves_of(kind, wide_)[next_leaf_] = make_leaf(kind, primitives_.data(), primitive_count_, *mesh_, wide_.scale);
    });
    return kBlockChild + next_leaf_++;
  }

  // Leaves are written roughly in the order of the binary tree's rows, so the triangles and vertices of later leaves
  // are prefetched. Inlined, because GCC drops calls that only prefetch.
  [[gnu::always_inline]] void fetch_ahead(std::size_t row) const noexcept {
    constexpr std::size_t kTrianglesAhead = 32, kVerticesAhead = 16;
    const auto& rows = plan_.tree().prim_indices;
    __builtin_prefetch(triangles_ + rows[std::min(row + kTrianglesAhead, rows.size() - 1)]);
    const TriangleIndices corners = triangles_[rows[std::min(row + kVerticesAhead, rows.size() - 1)]];
    for (const std::uint32_t vertex : {corners.x, corners.y, corners.z}) __builtin_prefetch(&mesh_->positions[vertex]);
  }

  // A subtree that fits into a leaf is at most 7 levels deep.
  void collect(std::uint32_t binary) {
    const Bvh2& tree = plan_.tree();
    const Bvh2Node& node = tree.nodes[binary];
    if (!node.is_leaf()) {
      collect(node.first);
      collect(node.first + 1);
      return;
    }
    for (std::uint32_t i = 0; i < node.count; ++i) {
      if (triangles_ != nullptr) fetch_ahead(node.first + i);
      const std::uint32_t primitive = tree.prim_indices[node.first + i];
      const auto end = primitives_.begin() + primitive_count_;
      if (!tree.refittable && std::find(primitives_.begin(), end, primitive) != end) continue;
      primitives_[primitive_count_++] = primitive;
    }
  }

  const Plan& plan_;
  const Mesh* mesh_;
  const TriangleIndices* triangles_;  // null: there are none
  WideBvh& wide_;
  std::vector<Waiting> waiting_;
  std::array<std::uint32_t, 8> primitives_;
  std::uint32_t primitive_count_ = 0;
  std::uint32_t next_node_ = 0, next_leaf_ = 0;
};

// In depth-first order.
std::vector<Part> make_parts(const Plan& plan) {
  std::vector<Part> parts, waiting;
  waiting.push_back({whole_range(plan.tree()), 1, 0, 0, false, {}});
  while (!waiting.empty()) {
    Part part = waiting.back();
    waiting.pop_back();
    const auto row = static_cast<std::uint32_t>(parts.size());
    part.is_subtree = plan.is_leaf(part.range.node) || size_of(plan.tree(), part.range) <= kSubtreeSize;
    part.totals = {1, 0, part.depth};
    parts.push_back(part);
    if (part.is_subtree) continue;
    const Children children = plan.children_of(part.range);
    for (std::uint32_t lane = children.count; lane-- > 0;) {
      waiting.push_back({children.ranges[lane], part.depth + 1, row, lane, false, {}});
    }
  }
  return parts;
}

void check_limits(const Totals& totals, bool is_top_level) {
  if (totals.nodes >= kBlockChild) throw EngineError("the tree has more nodes than a child can refer to");
  if (!is_top_level && totals.leaves >= kMostBlocks) {
    throw EngineError("the mesh has more leaves than a tree can refer to");
  }
}

}  // namespace

void emit_wide(const Bvh2& tree, const Mesh* mesh, std::span<const CollapseDecision> decisions, WideBvh& wide,
               ThreadPool& pool, CancelToken& cancel) {
  const Plan plan(tree, decisions);
  std::vector<Part> parts = make_parts(plan);
  const auto for_parts = [&](const auto& body) {
    for_chunks(pool, parts.size(), 1, cancel, [&](std::size_t begin, std::size_t end) {
      Emitter emitter(plan, mesh, wide);
      for (std::size_t i = begin; i < end; ++i) body(emitter, parts[i]);
    });
  };
  for_parts([](Emitter& emitter, Part& part) {
    if (part.is_subtree) part.totals = emitter.count(part);
  });
  Totals totals;
  for (Part& part : parts) {
    part.first_node = totals.nodes;
    part.first_leaf = totals.leaves;
    totals.nodes += part.totals.nodes;
    totals.leaves += part.totals.leaves;
    totals.depth = std::max(totals.depth, part.totals.depth);
  }
  check_limits(totals, mesh == nullptr);
  wide.depth = totals.depth;
  wide.nodes.resize(totals.nodes);
  if (mesh != nullptr) make_room_for_leaves(*mesh, totals.leaves, wide);
  for_parts([&](Emitter& emitter, Part& part) {
    emitter.write(part);
    cancel.advance(tree.prim_indices.size() * part.totals.leaves / (2 * totals.leaves));
  });
  const Emitter emitter(plan, mesh, wide);
  wide.root = emitter.child_of(parts[0]);
  for (std::size_t i = 1; i < parts.size(); ++i) {
    wide.nodes[parts[parts[i].parent].first_node].child[parts[i].lane] = emitter.child_of(parts[i]);
  }
}

}  // namespace perfect_bvh
