// Traces a batch as a stream. Up to 64 rays are in flight, each with its own stack, and all take their steps in turn:
// every ray at a node visits it, then every ray at a leaf tests it, and so on. Each ray visits nodes and leaves in the
// same order as if it were alone.
//
// Reason: a single ray waits. Its next node is known only after the last one's boxes have been tested, and its next
// direction is a branch that cannot be predicted. The steps of different rays do not depend on each other, and a step
// needs no branch: the kind of the next child (a node, a leaf, something else) only decides which list the slot is
// appended to. The other rays hide latency, including cache misses.
//
// Included by one translation unit for each instruction set, after its vectors. Longer than other files because the
// loop cannot be divided; everything has internal linkage.

namespace perfect_bvh {
namespace {

#include "traverse/pace.inl"
#include "traverse/ray_slot.inl"
constexpr std::size_t kEight = 8;  // rays that may start together
#ifdef __AVX2__
constexpr bool kHasEight = true;
// Needs ray_slot.inl.
#include "traverse/eight_rays.inl"
#else
constexpr bool kHasEight = false;
#endif
// Needs ray_slot.inl.
#include "traverse/leaf_test.inl"
// Needs leaf_test.inl.
#include "traverse/round_leaf.inl"
// Needs the leaf and node tests.

// Leaves are tested when this many rays wait at leaves, or no ray is left at a node.
constexpr std::size_t kLeafPatience = 16;

struct Stream {
  Stream(const SceneView& the_scene, const RayBatch& the_batch, std::size_t the_offset, std::size_t in_flight) noexcept
      : scene(the_scene),
        batch(the_batch),
        lone(lone_instance(the_scene)),
        nears_offset(the_offset),
        starts_in_eights(kHasEight && in_flight >= 2 * kEight && !the_scene.is_empty &&
                         (lone != nullptr || the_scene.root < kInstanceChild)) {}

  const SceneView& scene;
  const RayBatch& batch;
  const InstanceView* const lone;
  std::size_t nears_offset;     // from a slot's stack of children to its stack of entry distances, in entries
  const bool starts_in_eights;  // if nothing is counted
  Slot* at_node[kMostRaysInFlight + 1];
  Slot* at_between[kMostRaysInFlight + 1];  // also at a node, of a tree between two of its steps
  Slot* at_other[kMostRaysInFlight + 1];    // at leaves and marks
  Slot* at_leaf[kMostRaysInFlight + 1];
  Slot* at_mark[kMostRaysInFlight + 1];
  Slot* idle[kMostRaysInFlight + 1];  // without a ray
  std::size_t node_count = 0, between_count = 0, other_count = 0, leaf_count = 0, mark_count = 0, idle_count = 0;
  std::size_t next_ray = 0;

  [[nodiscard]] std::size_t count_at_nodes() const noexcept { return node_count + between_count; }
  [[nodiscard]] bool has_eight_left() const noexcept { return batch.count - next_ray >= kEight; }
  // A lone instance reads only its root, which stays in the cache.
  [[nodiscard]] bool fetches_instances() const noexcept { return scene.exceeds_cache && lone == nullptr; }
};

// Bytes of a child's row by its highest two bits, in trees over curves or points and over triangles. 0: not fetched.
constexpr std::uint32_t kRowBytes[2][4] = {{sizeof(WideNode), sizeof(WideNode), 0, 0},
                                           {sizeof(WideNode), sizeof(WideNode), sizeof(LeafBlock), 0}};

// Prefetches the node or leaf that a slot will visit next, while other slots take their steps. Its kind cannot be
// predicted. Compilers turn a choice between two bases into a branch, so the base is read by its offset.
template <bool kMoves>
PERFECT_BVH_INLINE void fetch_next(const Slot& slot, std::uint32_t next) noexcept {
  const std::size_t has_blocks = slot.blocks != nullptr, is_block = next >> 31 & has_blocks;
  const std::size_t offset = std::size_t{next & (kBlockChild / 2 - 1)} * kRowBytes[has_blocks][next >> 30];
  const std::size_t base = offsetof(Slot, nodes) + is_block * (offsetof(Slot, blocks) - offsetof(Slot, nodes));
  const char* lines;
  __builtin_memcpy(&lines, reinterpret_cast<const char*>(&slot) + base, sizeof(lines));
  for (int line = 0; line < 4; ++line) __builtin_prefetch(lines + offset + 64 * line);
  if constexpr (kMoves) {  // the next step's node, of which three lines are read
    if (slot.later_nodes == nullptr) return;
    const char* const later = is_block != 0 ? reinterpret_cast<const char*>(slot.step[1].leaves.blocks)
                                            : reinterpret_cast<const char*>(slot.later_nodes);
    for (int line = 0; line < 3; ++line) __builtin_prefetch(later + offset + 64 * line);
  }
}

// Moving instances are read in three dependent steps: the instance, its motion, its inverse motion.
__attribute__((noinline)) void fetch_motions(const Stream& stream) noexcept {
  __asm__ volatile("");  // compilers drop calls to functions that only prefetch
  const MotionView* motions[kMostRaysInFlight + 1];
  const float* times[kMostRaysInFlight + 1];
  std::size_t count = 0;
  for (std::size_t i = 0; i < stream.mark_count; ++i) {
    Slot& slot = *stream.at_mark[i];
    const std::uint32_t mark = stack_of(slot)[slot.top];
    if (mark >= kFirstMark) continue;
    const InstanceView& instance = stream.scene.instances[mark - kInstanceChild];
    if (instance.motion == 0) continue;
    motions[count] = stream.scene.motions + (instance.motion - 1), times[count] = &stream.batch.rays[slot.ray].time;
    __builtin_prefetch(motions[count++]);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (motions[i]->backs == nullptr) continue;
    const auto* const lines =
        reinterpret_cast<const char*>(motions[i]->backs + moment_at(motions[i]->turn_times, *times[i]).step);
    for (std::size_t line = 0; line < sizeof(TurnBack); line += 64) __builtin_prefetch(lines + line);
  }
}

// Prefetches the instances that slots will enter, before the leaves are tested.
template <bool kMoves>
inline void fetch_instances(Stream& stream) noexcept {
  for (std::size_t i = 0; i < stream.mark_count; ++i) {
    Slot& slot = *stream.at_mark[i];
    const std::uint32_t mark = stack_of(slot)[slot.top];
    if (mark >= kFirstMark) continue;
    const char* const lines = reinterpret_cast<const char*>(stream.scene.instances + (mark - kInstanceChild));
    for (std::size_t line = 0; line < sizeof(InstanceView); line += 64) __builtin_prefetch(lines + line);
  }
  if constexpr (kMoves) fetch_motions(stream);
}

// kBetween: visits only nodes of trees between two of their steps. They are visited separately, because a branch on the
// kind of tree cannot be predicted either.
template <bool kAny, bool kCounts, bool kFetches, bool kMoves, bool kBetween>
PERFECT_BVH_INLINE void visit_nodes(Stream& stream) noexcept {
  Slot** const at_node = kBetween ? stream.at_between : stream.at_node;
  Slot** const at_other = stream.at_other + stream.other_count;
  std::size_t& node_count = kBetween ? stream.between_count : stream.node_count;
  const std::size_t count = node_count, nears_offset = stream.nears_offset;
  std::size_t others = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Slot& slot = *at_node[i];
    std::uint32_t* const stack = stack_of(slot);
    std::uint32_t top = slot.top;
    const WideNode& node = slot.nodes[stack[top]];
    if constexpr (kCounts) ++stream.batch.counts[slot.ray].nodes_visited;
    const NodeTest test = kBetween ? test_moving_node(node, slot.later_nodes[stack[top]], slot.box, slot.moment)
                                   : test_node(node, slot.box);
    if constexpr (kAny) {
      top += push_unsorted(node, test.hit, stack + top) - 1;
    } else {
      top += push_sorted(node, slot.box.rows.order_shift, test.hit, test.near, stack + top,
                         reinterpret_cast<float*>(stack + nears_offset) + top) -
             1;
    }
    slot.top = top;
    at_node[i - others] = &slot;
    at_other[others] = &slot;
    const std::uint32_t next = stack[top];
    if constexpr (kFetches) fetch_next<kMoves>(slot, next);
    others += next >> 31;
  }
  node_count = count - others;
  stream.other_count += others;
}

template <bool kAny, bool kCounts, bool kFetches, bool kMoves>
PERFECT_BVH_INLINE void visit_all_nodes(Stream& stream) noexcept {
  visit_nodes<kAny, kCounts, kFetches, kMoves, false>(stream);
  if constexpr (kMoves) visit_nodes<kAny, kCounts, kFetches, true, true>(stream);
}

// Adds the slot to the list of slots at a node.
template <bool kMoves>
PERFECT_BVH_INLINE void put_at_node(Stream& stream, Slot& slot) noexcept {
  if (kMoves && slot.later_nodes != nullptr) {
    stream.at_between[stream.between_count++] = &slot;
  } else {
    stream.at_node[stream.node_count++] = &slot;
  }
}

// Needs the stream.
#include "traverse/stream_leaf.inl"

// A leaf of points is read in two dependent steps: numbers, then spheres. They are prefetched here for all waiting
// leaves together, to wait for the caches once and not once per leaf. A leaf of curves is two cache lines, and the
// segments that it names are seldom needed.
__attribute__((noinline)) void fetch_round_leaves(const Stream& stream) noexcept {
  __asm__ volatile("");  // compilers drop calls to functions that only prefetch
  bool has_points = false;
  for (std::size_t i = 0; i < stream.leaf_count; ++i) {
    Slot& slot = *stream.at_leaf[i];
    if (slot.blocks != nullptr) continue;
    const RoundLeaves& leaves = *stream.scene.instances[slot.instance].leaves.round_leaves;
    const std::uint32_t row = stack_of(slot)[slot.top] - kBlockChild;
    if (leaves.curves != nullptr) {
      __builtin_prefetch(&leaves.curves[row]), __builtin_prefetch(&leaves.curves[row].corner);
    } else {
      __builtin_prefetch(&leaves.points[row]), has_points = true;
    }
  }
  for (std::size_t i = 0; has_points && i < stream.leaf_count; ++i) {
    Slot& slot = *stream.at_leaf[i];
    if (slot.blocks != nullptr) continue;
    const RoundLeaves& leaves = *stream.scene.instances[slot.instance].leaves.round_leaves;
    if (leaves.curves != nullptr) continue;
    const PointLeaf& leaf = leaves.points[stack_of(slot)[slot.top] - kBlockChild];
    for (const std::uint32_t primitive : leaf.primitives) __builtin_prefetch(&leaves.round.balls[primitive]);
  }
}

template <bool kAny, bool kCounts, bool kMoves>
PERFECT_BVH_INLINE void visit_leaves(Stream& stream) noexcept {
  const std::size_t count = stream.leaf_count;
  std::size_t nodes = stream.node_count, betweens = stream.between_count, others = stream.other_count;
  if (count != 0 && stream.at_leaf[0]->blocks == nullptr) fetch_round_leaves(stream);
  for (std::size_t i = 0; i < count; ++i) {
    Slot& slot = *stream.at_leaf[i];
    std::uint32_t* const stack = stack_of(slot);
    const std::uint32_t row = stack[slot.top] - kBlockChild;
    visit_any_leaf<kAny, kCounts, kMoves>(stream, slot, row);
    stream.at_node[nodes] = &slot;
    if constexpr (kMoves) stream.at_between[betweens] = &slot;
    stream.at_other[others] = &slot;
    if (stream.scene.exceeds_cache) fetch_next<kMoves>(slot, stack[slot.top]);
    const std::uint32_t is_other = stack[slot.top] >> 31;
    others += is_other;
    const std::uint32_t is_between = kMoves && slot.later_nodes != nullptr ? 1 - is_other : 0;
    nodes += 1 - is_other - is_between;
    betweens += is_between;
  }
  stream.node_count = nodes;
  if constexpr (kMoves) stream.between_count = betweens;
  stream.other_count = others;
  stream.leaf_count = 0;
}

template <bool kAny>
inline void write_result(const RayBatch& batch, std::size_t row, const Slot* slot) noexcept {
  const bool found = slot != nullptr && slot->hit_instance != kNoHit;
  if constexpr (kAny) {
    batch.occluded[row] = found ? 1 : 0;
  } else {
    Hit& hit = batch.hits[row];
    if (slot == nullptr) return static_cast<void>(hit = Hit{});
    hit.t = found ? static_cast<float>(slot->best_t) + 0.0f : kInfiniteDistance;  // no -0
    hit.u = slot->u, hit.v = slot->v;
    hit.instance_index = slot->hit_instance, hit.primitive_index = slot->hit_primitive;
  }
}

// Starts the next ray of the batch that can hit anything; returns false if none is left.
template <bool kAny, bool kCounts, bool kMoves>
PERFECT_BVH_INLINE bool take_next_ray(Stream& stream, Slot& slot) noexcept {
  while (stream.next_ray < stream.batch.count) {
    const std::size_t row = row_of(stream.batch, stream.next_ray++);
    if constexpr (kCounts) stream.batch.counts[row].nodes_visited = stream.batch.counts[row].primitives_tested = 0;
    slot.ray = static_cast<std::uint32_t>(row);
    if (stream.lone != nullptr && start_directly<kMoves>(slot, stream.scene, stream.batch.rays[row])) {
      if constexpr (kCounts) ++stream.batch.counts[row].nodes_visited;
      return true;
    }
    if (!stream.scene.is_empty && start_ray<kMoves>(slot, stream.scene, stream.batch.rays[row])) return true;
    write_result<kAny>(stream.batch, row, nullptr);
  }
  return false;
}

// Starts the next eight rays in eight idle slots, if these are usual ones. Returns false if they do not start.
template <bool kMoves>
__attribute__((noinline)) bool take_next_eight([[maybe_unused]] Stream& stream) noexcept {
#ifdef __AVX2__
  const SceneView& scene = stream.scene;
  const InstanceView* const lone = stream.lone;
  alignas(32) std::uint32_t rows[kEight];
  Slot* slots[kEight];
  for (std::size_t i = 0; i < kEight; ++i) {
    rows[i] = static_cast<std::uint32_t>(row_of(stream.batch, stream.next_ray + i));
    slots[i] = stream.idle[stream.idle_count - kEight + i];
  }
  const bool has_begun = lone != nullptr ? start_eight<true, kMoves>(slots, stream.batch, rows, scene)
                                         : start_eight<false, kMoves>(slots, stream.batch, rows, scene);
  if (!has_begun) return false;
  const bool at_node = (lone != nullptr ? lone->root : scene.root) < kBlockChild;
  for (Slot* const slot : slots) {
    if (at_node) {
      put_at_node<kMoves>(stream, *slot);
    } else {
      stream.at_leaf[stream.leaf_count++] = slot;
    }
  }
  stream.idle_count -= kEight, stream.next_ray += kEight;
  return true;
#else
  return false;
#endif
}

// Starts the next ray in the slot, if any is left.
template <bool kAny, bool kCounts, bool kMoves>
PERFECT_BVH_INLINE void take_next_singly(Stream& stream, Slot& slot) noexcept {
  if (!take_next_ray<kAny, kCounts, kMoves>(stream, slot)) return;
  if (stack_of(slot)[slot.top] < kBlockChild) {
    put_at_node<kMoves>(stream, slot);
  } else {
    stream.at_other[stream.other_count++] = &slot;
  }
}

// Starts the next rays in the idle slots: eight at a time while there are enough of both, the last rays of the batch
// one by one.
template <bool kAny, bool kCounts, bool kMoves>
__attribute__((noinline)) void take_next_rays(Stream& stream) noexcept {
  const bool in_eights = !kCounts && stream.starts_in_eights;
  while (in_eights && stream.idle_count >= kEight && stream.has_eight_left()) {
    if (take_next_eight<kMoves>(stream)) continue;
    for (std::size_t i = 0; i < kEight; ++i) {
      take_next_singly<kAny, kCounts, kMoves>(stream, *stream.idle[--stream.idle_count]);
    }
  }
  if (in_eights && stream.has_eight_left()) return;
  while (stream.idle_count != 0) {
    take_next_singly<kAny, kCounts, kMoves>(stream, *stream.idle[--stream.idle_count]);
  }
}

// Follows the marks on each waiting slot's stack until the slot is at a node or a leaf, or has no ray left.
template <bool kAny, bool kCounts, bool kMoves>
void follow_marks(Stream& stream) noexcept {
  const bool in_eights = !kCounts && stream.starts_in_eights;
  for (std::size_t i = 0; i < stream.mark_count; ++i) {
    Slot& slot = *stream.at_mark[i];
    const std::uint32_t* const stack = stack_of(slot);
    bool is_active = true;
    while (is_active && stack[slot.top] >= kInstanceChild) {
      const std::uint32_t mark = stack[slot.top];
      if (mark == kDoneMark) {
        write_result<kAny>(stream.batch, slot.ray, &slot);
        if (in_eights) {
          stream.idle[stream.idle_count++] = &slot;
          is_active = false;
        } else {
          is_active = take_next_ray<kAny, kCounts, kMoves>(stream, slot);
        }
      } else if (mark == kLeaveMark) {
        leave_instance<kAny, kMoves>(slot, stream.scene, stream.nears_offset);
      } else {
        if constexpr (kCounts) ++stream.batch.counts[slot.ray].nodes_visited;
        if (!enter_instance<kMoves>(slot, stream.scene, stream.batch.rays[slot.ray])) --slot.top;
      }
    }
    if (!is_active) continue;
    if (stream.fetches_instances()) fetch_next<kMoves>(slot, stack[slot.top]);
    if (stack[slot.top] >= kBlockChild) {
      stream.at_leaf[stream.leaf_count++] = &slot;
    } else {
      put_at_node<kMoves>(stream, slot);
    }
  }
  stream.mark_count = 0;
  if (stream.idle_count != 0) take_next_rays<kAny, kCounts, kMoves>(stream);
}

inline void sort_others(Stream& stream) noexcept {
  std::size_t leaves = stream.leaf_count, marks = stream.mark_count;
  for (std::size_t i = 0; i < stream.other_count; ++i) {
    Slot& slot = *stream.at_other[i];
    const std::uint32_t is_mark = (stack_of(slot)[slot.top] >> 30) & 1;
    stream.at_leaf[leaves] = &slot;
    stream.at_mark[marks] = &slot;
    leaves += 1 - is_mark;
    marks += is_mark;
  }
  stream.leaf_count = leaves;
  stream.mark_count = marks;
  stream.other_count = 0;
}

// Returns the entries of a stack: as many as any ray may need, and 8 more that pushes may overwrite.
inline std::size_t padded_entries(const SceneView& scene) noexcept {
  return (std::size_t{scene.stack_entries} + 8 + 15) / 16 * 16;
}

// Returns the bytes of a slot with its stacks: an odd number of cache lines, so that slots do not compete for the same
// cache sets.
inline std::size_t slot_bytes(const SceneView& scene) noexcept {
  const std::size_t lines = sizeof(Slot) / 64 + padded_entries(scene) / 8;
  return 64 * (lines | 1);
}

std::size_t stream_workspace_bytes(const SceneView& scene, std::size_t in_flight) {
  return slot_bytes(scene) * in_flight;
}

// Traces one ray to its end, in a tree that it has entered, of a scene in which something moves.
template <bool kAny>
void finish_alone(Stream& stream, Slot& slot, Pace& pace) noexcept {
  std::uint32_t* const stack = stack_of(slot);
  while (stack[slot.top] != kDoneMark) {
    const std::uint32_t next = stack[slot.top];
    if (next >= kBlockChild) {
      if (pace.should_stop()) return;
      visit_any_leaf<kAny, false, true>(stream, slot, next - kBlockChild);
      continue;
    }
    const WideNode& node = slot.nodes[next];
    const NodeTest test = test_any_node(slot, next);
    if constexpr (kAny) {
      slot.top += push_unsorted(node, test.hit, stack + slot.top) - 1;
    } else {
      float* const nears = reinterpret_cast<float*>(stack + stream.nears_offset) + slot.top;
      slot.top += push_sorted(node, slot.box.rows.order_shift, test.hit, test.near, stack + slot.top, nears) - 1;
    }
  }
}

template <bool kAny, bool kCounts, bool kMoves>
void trace_stream(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight) noexcept {
  Stream stream(scene, batch, padded_entries(scene), in_flight);
  for (std::size_t i = 0; i < in_flight; ++i) {
    Slot& slot = *reinterpret_cast<Slot*>(static_cast<char*>(workspace) + i * slot_bytes(scene));
    if (stream.lone != nullptr) prepare_slot(slot, scene, *stream.lone);
    stream.idle[stream.idle_count++] = &slot;
  }
  take_next_rays<kAny, kCounts, kMoves>(stream);
  Pace pace(scene.interruption);
  while (stream.count_at_nodes() + stream.other_count + stream.leaf_count != 0) {
    if (pace.should_stop()) return;
    while (stream.count_at_nodes() != 0 && stream.other_count + stream.leaf_count < kLeafPatience) {
      if (scene.exceeds_cache) {
        visit_all_nodes<kAny, kCounts, true, kMoves>(stream);
      } else {
        visit_all_nodes<kAny, kCounts, false, kMoves>(stream);
      }
    }
    sort_others(stream);
    if (stream.fetches_instances()) fetch_instances<kMoves>(stream);
    visit_leaves<kAny, kCounts, kMoves>(stream);
    follow_marks<kAny, kCounts, kMoves>(stream);
  }
}

template <bool kAny>
void trace_in_stream(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight) {
  const bool counts = batch.counts != nullptr, moves = scene.motions != nullptr;
  const auto trace = counts ? (moves ? trace_stream<kAny, true, true> : trace_stream<kAny, true, false>)
                            : (moves ? trace_stream<kAny, false, true> : trace_stream<kAny, false, false>);
  trace(scene, batch, workspace, in_flight);
}

}  // namespace
}  // namespace perfect_bvh
