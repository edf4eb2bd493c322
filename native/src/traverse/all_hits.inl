// Finds every triangle that a ray hits in its range, and every visible end of a chord in curves and points. Counts them
// or writes them unsorted, ray by ray. No hit shortens the ray, so the order of visits is free and no entry distance is
// stored.
// A triangle that is in several leaves (spatial splits) is found in each. The caller, which may allocate, sorts the
// hits and drops repetitions.
// Included after stream_kernel.inl, whose slots, node tests and leaf tests it uses; everything has internal linkage.

namespace perfect_bvh {
namespace {

// Takes the hits lane by lane. Null `hits`: only counts. Returns the number of hits, which may exceed the room for
// them.
template <class Leaf>
PERFECT_BVH_INLINE std::size_t take_all(const Slot& slot, const InstanceView& /*instance*/, const Leaf& leaf,
                                        const RayBatch& batch, std::uint32_t /*row*/, FoundHit* hits,
                                        std::size_t room) noexcept {
  const LeafTest test = test_leaf(leaf, slot.triangle);
  if (test.lanes == 0) return 0;
  const LeafCandidates candidates(test);
  const Ray& ray = batch.rays[slot.ray];
  std::size_t count = 0;
  for (unsigned lanes = test.lanes; lanes != 0; lanes &= lanes - 1) {
    const int lane = __builtin_ctz(lanes);
    Meeting at;
    if (!meet_candidate(at, candidates, lane, leaf, slot.triangle, slot.local)) continue;
    if (!is_in_range(at.t, ray) || is_culled(batch.cull, at.sum, slot.triangle.ray, slot.is_mirrored)) continue;
    if (hits != nullptr && count < room) {
      hits[count] = {at.t, at.weight_v1 / at.sum, at.weight_v2 / at.sum, slot.instance, leaf.primitives[lane]};
    }
    ++count;
  }
  return count;
}

// The same for curves or points: where a ray enters (v = 0) and leaves (v = 1) them. Ribbons have only one hit (v = 0).
inline std::size_t take_all(const Slot& slot, const InstanceView& instance, const RoundLeaves& leaves,
                            const RayBatch& batch, std::uint32_t row, FoundHit* hits, std::size_t room) noexcept {
  const RoundList& list = leaves.round;
  const RoundCandidates candidates(leaves, row, slot.local, slot.box.t_min, slot.box.t_limit, instance.extent.reach);
  const RoundRay ray = round_ray(slot.local.origin, slot.local.direction);
  std::size_t count = 0;
  const auto take = [&](double t, std::uint32_t primitive, double local_t, float is_exit) {
    if (hits != nullptr && count < room) {
      const auto u = static_cast<float>(share_of(ray, list, primitive, local_t));
      hits[count] = {t, u, is_exit, slot.instance, primitive};
    }
    ++count;
  };
  for (unsigned lanes = candidates.lanes; lanes != 0; lanes &= lanes - 1) {
    const std::uint32_t primitive = candidates.primitives[__builtin_ctz(lanes)];
    RoundMeeting at;
    if (!meet_round(at, ray, list, primitive, slot.local.time)) continue;
    const bool may_enter = is_in_range(at.entry, batch.rays[slot.ray]);
    const bool may_exit = batch.cull != Cull::kBack && is_in_range(at.exit, batch.rays[slot.ray]);
    if (!may_enter && !may_exit) continue;
    const ShownEnds shows = shown_ends(ray, list, primitive, at.chord);
    if (may_enter && shows.entry) take(at.entry, primitive, at.chord.entry, 0.0f);
    if (may_exit && shows.exit) take(at.exit, primitive, at.chord.exit, 1.0f);
  }
  return count;
}

template <bool kMoves>
inline std::size_t visit_whole_leaf(const Slot& slot, const SceneView& scene, const RayBatch& batch, std::uint32_t row,
                                    FoundHit* hits, std::size_t room) noexcept {
  const InstanceView& instance = scene.instances[slot.instance];
  return with_leaf<kMoves>(slot, instance, row, [&](const auto& leaf) __attribute__((always_inline)) {
    return take_all(slot, instance, leaf, batch, row, hits, room);
  });
}

// Returns the number of hits of the slot's ray. Writes those for which there is room to `hits`, unless it is null.
template <bool kMoves>
inline std::size_t walk_whole_ray(Slot& slot, const SceneView& scene, const RayBatch& batch, FoundHit* hits,
                                  std::size_t room, Pace& pace) noexcept {
  std::uint32_t* const stack = stack_of(slot);
  std::size_t count = 0;
  while (stack[slot.top] != kDoneMark) {
    const std::uint32_t entry = stack[slot.top];
    if (entry < kBlockChild) {
      const WideNode& node = slot.nodes[entry];
      const NodeTest test = kMoves ? test_any_node(slot, entry) : test_node(node, slot.box);
      slot.top += push_unsorted(node, test.hit, stack + slot.top) - 1;
    } else if (pace.should_stop()) {
      return count;
    } else if (entry < kInstanceChild) {
      const std::size_t left = count < room ? room - count : 0;
      count += visit_whole_leaf<kMoves>(slot, scene, batch, entry - kBlockChild, left ? hits + count : nullptr, left);
      --slot.top;
    } else if (entry == kLeaveMark) {
      leave_instance<true, kMoves>(slot, scene, 0);
    } else if (!enter_instance<kMoves>(slot, scene, batch.rays[slot.ray])) {
      --slot.top;
    }
  }
  return count;
}

template <bool kMoves>
std::size_t find_every_hit(const SceneView& scene, const RayBatch& batch, const FoundHits& found, void* workspace) {
  Slot& slot = *static_cast<Slot*>(workspace);
  Pace pace(scene.interruption);
  std::size_t used = 0;
  for (std::size_t row = 0; row < batch.count; ++row) {
    slot.ray = static_cast<std::uint32_t>(row);
    std::size_t count = 0;
    if (!scene.is_empty && start_ray<kMoves>(slot, scene, batch.rays[row])) {
      FoundHit* const hits = found.hits == nullptr ? nullptr : found.hits + used;
      count = walk_whole_ray<kMoves>(slot, scene, batch, hits, found.capacity - used, pace);
    }
    found.counts[row] = count;
    if (found.hits == nullptr) continue;
    if (count > found.capacity - used) return row;
    used += count;
  }
  return batch.count;
}

std::size_t find_all_hits(const SceneView& scene, const RayBatch& batch, const FoundHits& found, void* workspace) {
  if (scene.motions != nullptr) return find_every_hit<true>(scene, batch, found, workspace);
  return find_every_hit<false>(scene, batch, found, workspace);
}

}  // namespace
}  // namespace perfect_bvh
