// Visits a leaf, of any kind, with a ray of a stream.
// Part of stream_kernel.inl: everything has internal linkage.

// Tests the triangles in `lanes`, whose t may be in range, more closely. Returns true if there is a new best hit (any
// hit: if there is a hit).
template <bool kAny, class Leaf>
PERFECT_BVH_INLINE bool take_hits(Slot& slot, const Stream& stream, const Leaf& leaf, unsigned lanes,
                                  const LeafCandidates& candidates) noexcept {
  const Ray& ray = stream.batch.rays[slot.ray];
  const InstanceView* const instances = stream.scene.instances;
  const Cull cull = stream.batch.cull;
  bool is_new = false;
  for (; lanes != 0; lanes &= lanes - 1) {
    const int lane = __builtin_ctz(lanes);
    if constexpr (kAny) {
      if (is_surely_hit(slot, cull, leaf, lane, candidates)) return true;
    }
    if (!take_hit(slot, instances, ray, cull, leaf, lane, candidates)) continue;
    if constexpr (kAny) return true;
    is_new = true;
  }
  return is_new;
}

// Continues after a new best hit (any hit: after a hit).
template <bool kAny>
PERFECT_BVH_INLINE void go_on_from_hit(const Stream& stream, Slot& slot) noexcept {
  if constexpr (kAny) {
    slot.top = 0;
  } else {
    set_limit(slot);
    drop_far_entries(slot, stream.nears_offset);
  }
}

template <bool kAny, bool kCounts, class Leaf>
PERFECT_BVH_INLINE void visit_leaf(Stream& stream, Slot& slot, const Leaf& leaf) noexcept {
  const LeafTest test = test_leaf(leaf, slot.triangle);
  if constexpr (kCounts) stream.batch.counts[slot.ray].primitives_tested += count_triangles(leaf.primitives);
  --slot.top;
  if (test.lanes == 0) return;
  const LeafCandidates candidates(test);
  if (take_hits<kAny>(slot, stream, leaf, test.lanes, candidates)) go_on_from_hit<kAny>(stream, slot);
}

// Tests the candidates of curves or points, at least one. Out of line: most leaf visits end earlier, and need neither
// its registers nor its stack.
template <bool kAny>
__attribute__((noinline)) void take_round_hits(Stream& stream, Slot& slot, const RoundList& list,
                                               RoundCandidates candidates) noexcept {
  const RoundRay ray = round_ray(slot.local.origin, slot.local.direction);
  bool is_new = false;
  for (unsigned lanes = candidates.lanes; lanes != 0 && !(kAny && is_new); lanes &= lanes - 1) {
    is_new |= take_round_hit(slot, stream.scene.instances, stream.batch.rays[slot.ray], stream.batch.cull, ray, list,
                             candidates.primitives[__builtin_ctz(lanes)]);
  }
  if (is_new) go_on_from_hit<kAny>(stream, slot);
}

// Visits a leaf of curves or points.
template <bool kAny, bool kCounts>
__attribute__((noinline)) void visit_round_leaf(Stream& stream, Slot& slot, const RoundLeaves& leaves,
                                                std::uint32_t row) noexcept {
  const InstanceView& instance = stream.scene.instances[slot.instance];
  if constexpr (kCounts) stream.batch.counts[slot.ray].primitives_tested += count_round(leaves, row);
  --slot.top;
  const RoundCandidates candidates(leaves, row, slot.local, slot.box.t_min, slot.box.t_limit, instance.extent.reach);
  if (candidates.lanes != 0) take_round_hits<kAny>(stream, slot, leaves.round, candidates);
}

// Visits a triangle leaf of a moving tree between two steps.
template <bool kAny, bool kCounts>
PERFECT_BVH_INLINE void visit_moving_block(Stream& stream, Slot& slot, std::uint32_t row) noexcept {
  visit_leaf<kAny, kCounts>(stream, slot, MovingBlock(slot.step, slot.moment, row, slot.span_slack));
}

// Visits any other leaf of a moving tree.
template <bool kAny, bool kCounts>
__attribute__((noinline)) void visit_moving_leaf(Stream& stream, Slot& slot, std::uint32_t row) noexcept {
  if (slot.blocks == nullptr) {
    return visit_round_leaf<kAny, kCounts>(stream, slot, moving_leaves(slot.step, slot.moment), row);
  }
  visit_leaf<kAny, kCounts>(stream, slot, slot.blocks[row]);
}

template <bool kAny, bool kCounts, bool kMoves>
PERFECT_BVH_INLINE void visit_any_leaf(Stream& stream, Slot& slot, std::uint32_t row) noexcept {
  if (kMoves && slot.step != nullptr) {
    if (slot.moment.is_between() && slot.blocks != nullptr) return visit_moving_block<kAny, kCounts>(stream, slot, row);
    return visit_moving_leaf<kAny, kCounts>(stream, slot, row);
  }
  if (slot.blocks != nullptr) return visit_leaf<kAny, kCounts>(stream, slot, slot.blocks[row]);
  visit_round_leaf<kAny, kCounts>(stream, slot, *stream.scene.instances[slot.instance].leaves.round_leaves, row);
}
