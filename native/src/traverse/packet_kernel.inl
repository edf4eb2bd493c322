// Traces coherent rays in packets of up to 64 that share one stack (ranged traversal: Wald, Boulos and Shirley 2007;
// Overbeck, Ramamoorthi and Mark 2008).
//
// A node's eight boxes are first tested against bounds of the whole packet. A surviving child waits on the stack. When
// it is next, its box is tested against the rays, a vector at a time, from the first ray that entered its parent up to
// the first that enters the child. The node is then visited with that ray and all after it. Only leaves test every ray.
// So a node costs about two tests, no matter how many rays pass through it. When few rays are left, each finishes the
// subtree alone. Rays of a packet that differ in octant or longest axis are traced in separate passes.
//
// A ray may be tested against more boxes and triangles than it would be alone, but never misses a box or triangle that
// it can hit. The best hit does not depend on the order (math/slab.h, leaf_test.inl). So the answers are, bit for bit,
// those of the stream.
//
// Included by translation units that have vectors of rays, after stream_kernel.inl.

namespace perfect_bvh {
namespace {

#include "traverse/packet_setup.inl"
// The files below need the packet and its set-up, both in packet_setup.inl.
#include "traverse/packet_bounds.inl"
#include "traverse/packet_leaf.inl"

// At most this many rays go on alone.
constexpr unsigned kFewInNode = 3;

// kMoves: something moves within the shutter. The packet then traverses the top level with boxes around the whole
// motion of its instances. Its rays enter moving instances one by one.
template <bool kAny, bool kMoves>
struct PacketWalk {
  Packet& packet;
  const SceneView& scene;
  const RayBatch& batch;

  // Traces ray i alone through the subtree `child`.
  void walk_alone(PacketLevel& level, unsigned i, std::uint32_t child, unsigned base) noexcept {
    LoneRay lone(packet, level, i);
    std::uint32_t* const children = packet.stack.children + base;
    float* const nears = packet.stack.nears + base;
    const std::uint32_t order_shift = lone.box.rows.order_shift;
    children[0] = child;
    nears[0] = lone.box.t_min;
    for (unsigned top = 1; top != 0;) {
      --top;
      if (!kAny && nears[top] > lone.box.t_limit) continue;
      const std::uint32_t next = children[top];
      if (next >= kBlockChild) {
        if (packet.pace->should_stop()) return;
        if (visit_leaf_alone<kAny>(packet, level, next - kBlockChild, i, lone) && kAny) return;
        continue;
      }
      const WideNode& node = level.nodes[next];
      const NodeTest test = test_node(node, lone.box);
      if constexpr (kAny) {
        top += push_unsorted(node, test.hit, children + top);
      } else {
        top += push_sorted(node, order_shift, test.hit, test.near, children + top, nears + top);
      }
    }
  }

  void walk_each_alone(PacketLevel& level, RaySet rays, std::uint32_t child, unsigned base) noexcept {
    packet.alone += count_rays(rays);
    for (; rays != 0; rays &= rays - 1) walk_alone(level, first_ray(rays), child, base);
    level.bounds.t_limit = highest_limit(packet, *level.boxes);
  }

  // Pushes the children that ray `first` or a later one may enter. The highest entry is then `top` - 1.
  void push_children(const PacketLevel& level, std::uint32_t row, unsigned first, unsigned& top) noexcept {
    const WideNode& node = level.nodes[row];
    const NodeTest test = test_bounds(node, level.key.rows, level.bounds);
    const PacketStack& stack = packet.stack;
    for (unsigned i = 0; i < 8; ++i) stack.parents[top + i] = row;
    top += push_boxes(node, level.key.rows.order_shift, test.hit, test.near, first << 3, stack.children + top,
                      stack.nears + top, stack.places + top);
  }

  // Traces all of `rays`, which have one key, through the tree of `level`.
  template <bool kTop>
  void walk(PacketLevel& level, RaySet rays, std::uint32_t root, unsigned base) noexcept {
    if constexpr (!kTop) {
      // A tree that is a single leaf has no box.
      if (count_rays(rays) <= kFewInNode || root >= kBlockChild) return walk_each_alone(level, rays, root, base);
    }
    unsigned top = base;
    push_children(level, root, 0, top);
    const PacketStack& stack = packet.stack;
    while (top != base) {
      --top;
      if (stack.nears[top] > level.bounds.t_limit) continue;
      const std::uint32_t child = stack.children[top], place = stack.places[top];
      const PacketBox box(level.key.rows, level.nodes[stack.parents[top]].planes[0] + (place & 7));
      unsigned first = place >> 3;
      if (child >= kBlockChild) {
        if (packet.pace->should_stop()) return;
        if constexpr (kTop) {
          enter_instance(level, entering(*level.boxes, box, first, packet.lanes), child, top);
        } else {
          visit_packet_leaf<kAny>(packet, level, child - kBlockChild, box, first);
        }
        continue;
      }
      unsigned lanes = 0;
      for (; first < packet.lanes; first += kRayLanes) {
        lanes = test_box(*level.boxes, box, first);
        if (lanes != 0) break;
      }
      if (lanes == 0) continue;
      if (!kTop && count_bits(lanes) <= kFewInNode) {
        const RaySet few = from_bits(lanes, first) | entering(*level.boxes, box, first + kRayLanes, packet.lanes);
        if (count_rays(few) <= kFewInNode) {
          walk_each_alone(level, few, child, top);
          continue;
        }
      }
      push_children(level, child, first, top);
    }
  }

  // Sets whether the rays share an origin and are direct, which speeds up leaf tests.
  void set_shortcuts(PacketLevel& level, RaySet rays) const noexcept {
    const PacketRays& local = packet.local_rays;
    const unsigned first = first_ray(rays);
    level.is_direct = (local.moved & rays) == 0;
    level.shares_origin = true;
    for (int axis = 0; axis < 3; ++axis) {
      level.exact_origin[axis] = local.origin[axis][first];
      level.shared_origin[axis] = local.narrow_origin[axis][first];
      const RayDouble shared = every_ray(level.exact_origin[axis]), none = every_ray(0.0);
      for (unsigned i = 0; i < packet.lanes && level.shares_origin; i += kDoubleLanes) {
        const unsigned alike = magnitudes_up_to(sub(load_rays(local.origin[axis] + i), shared), none);
        const unsigned others = ~alike & ((1u << kDoubleLanes) - 1);
        level.shares_origin = (others & lanes_of(rays, i)) == 0;
      }
    }
  }

  // Returns those of `rays` that see the instance.
  [[nodiscard]] RaySet seeing(const InstanceView& instance, RaySet rays) const noexcept {
    if ((instance.mask & packet.common_mask) != 0) return rays;
    for (RaySet left = rays; left != 0; left &= left - 1) {
      if ((instance.mask & packet.rays[first_ray(left)]->mask) == 0) rays &= ~(left & -left);
    }
    return rays;
  }

  // Traces `rays`, mapped to its tree, through an instance.
  void trace_instance(std::uint32_t index, RaySet rays, unsigned base) noexcept {
    const InstanceView& instance = scene.instances[index];
    PacketLevel level;
    level.nodes = instance.nodes, level.blocks = blocks_of(instance), level.boxes = &packet.local;
    level.instance = &instance, level.instance_index = index;
    for (RaySet left = rays; left != 0;) {
      const RaySet alike = of_one_key(packet.local_rays, left, level.key);
      left &= ~alike;
      set_constants(packet.local, packet.triangles, packet.local_rays, alike, packet.lanes, level.key, instance.extent);
      set_ranges<kAny>(packet.local, packet, packet.local_rays, alike);
      set_bounds(level.bounds, packet, packet.local, alike, packet.local_rays, instance.extent);
      set_shortcuts(level, alike);
      walk<false>(level, alike, instance.root, base);
    }
  }

  // Traces ray i alone through a moving instance, as the stream does.
  void enter_alone(std::uint32_t index, unsigned i) noexcept {
    PacketHits& hits = packet.hits;
    Slot& slot = *packet.slot;
    slot.ray = packet.rows[i], slot.instance = kNoHit;
    load_ray(slot.world, *packet.rays[i], static_cast<double>(scene.scale));
    slot.world_time = packet.world_rays.time(i);
    slot.best_t = hits.t[i];
    slot.hit_instance = hits.instance[i], slot.hit_primitive = hits.primitive[i];
    slot.u = slot.v = 0.0f;
    std::uint32_t* const stack = stack_of(slot);
    stack[0] = kDoneMark, stack[1] = kInstanceChild + index;
    slot.top = 1;
    if (!::perfect_bvh::enter_instance<true>(slot, scene, *packet.rays[i])) return;
    Stream stream(scene, batch, padded_entries(scene), 1);
    finish_alone<kAny>(stream, slot, *packet.pace);
    if (slot.hit_instance != index) return;
    hits.t[i] = slot.best_t;
    hits.weight_v1[i] = slot.u, hits.weight_v2[i] = slot.v, hits.weight_sum[i] = 1.0f;
    hits.instance[i] = index, hits.primitive[i] = slot.hit_primitive;
    packet.occluded |= RaySet{1} << i;
  }

  void enter_instance(PacketLevel& top_level, RaySet rays, std::uint32_t child, unsigned base) noexcept {
    const std::uint32_t index = child - kInstanceChild;
    const InstanceView& instance = scene.instances[index];
    rays = seeing(instance, rays);
    if (rays == 0) return;
    if (kMoves && instance.motion != 0) {
      packet.alone += count_rays(rays);
      for (RaySet left = rays; left != 0; left &= left - 1) enter_alone(index, first_ray(left));
    } else {
      if (count_rays(rays) < kLeastRays) packet.alone += count_rays(rays);  // too few to pay off the set-up
      rays = map_packet(packet, rays, instance);
      trace_instance(index, rays, base);
    }
    if (top_level.boxes == nullptr || rays == 0) return;
    set_ranges<kAny>(packet.world, packet, packet.world_rays, top_level.members);
    top_level.bounds.t_limit = highest_limit(packet, packet.world);
  }

  void clear_hits() noexcept {
    PacketHits& hits = packet.hits;
    packet.occluded = 0;
    for (unsigned i = 0; i < kPacketRays; ++i) {
      hits.instance[i] = hits.primitive[i] = kNoHit;
      hits.weight_v1[i] = hits.weight_v2[i] = 0.0f;
      hits.weight_sum[i] = 1.0f;
    }
  }

  // Traces unmapped rays through a scene's only instance.
  void trace_directly(const InstanceView& instance, RaySet active) noexcept {
    clear_hits();
    active = seeing(instance, active);
    if (count_rays(active) < kLeastRays) packet.alone += count_rays(active);
    trace_instance(scene.root - kInstanceChild, active, 0);
  }

  void trace(RaySet active) noexcept {
    clear_hits();
    PacketLevel level;
    level.nodes = scene.nodes, level.blocks = nullptr, level.boxes = nullptr;
    if (scene.root >= kInstanceChild) {  // a single instance: the top level has no boxes
      if (active != 0) enter_instance(level, active, scene.root, 0);
      return;
    }
    level.boxes = &packet.world;
    while (active != 0) {
      level.members = of_one_key(packet.world_rays, active, level.key);
      active &= ~level.members;
      set_constants(packet.world, packet.triangles, packet.world_rays, level.members, packet.lanes, level.key,
                    scene.extent);
      set_ranges<kAny>(packet.world, packet, packet.world_rays, level.members);
      set_bounds(level.bounds, packet, packet.world, level.members, packet.world_rays, scene.extent);
      walk<true>(level, level.members, scene.root, 0);
    }
  }
};

// Returns the entries of a stack: as many as any ray may need, and extra ones that pushes may overwrite.
inline std::size_t packet_stack_entries(const SceneView& scene) noexcept {
  return (std::size_t{scene.stack_entries} + 16 + 15) / 16 * 16;
}

std::size_t packet_workspace_bytes(const SceneView& scene) {
  const std::size_t slot = scene.motions != nullptr ? slot_bytes(scene) : 0;  // last
  return sizeof(Packet) + packet_stack_entries(scene) * 4 * sizeof(std::uint32_t) + slot;
}

// Converts weights to barycentric coordinates.
inline void divide_weights(Packet& packet) noexcept {
  PacketHits& hits = packet.hits;
  for (unsigned i = 0; i < packet.lanes; i += kRayLanes) {
    const RayFloat sum = load_rays(hits.weight_sum + i);
    store_rays(hits.weight_v1 + i, div(load_rays(hits.weight_v1 + i), sum));
    store_rays(hits.weight_v2 + i, div(load_rays(hits.weight_v2 + i), sum));
  }
}

template <bool kAny>
void write_results(const Packet& packet, const RayBatch& batch) noexcept {
  const PacketHits& hits = packet.hits;
  for (unsigned i = 0; i < packet.count; ++i) {
    if constexpr (kAny) {
      batch.occluded[packet.rows[i]] = packet.occluded >> i & 1;
    } else {
      const bool found = hits.instance[i] != kNoHit;
      Hit& hit = batch.hits[packet.rows[i]];
      hit.t = found ? static_cast<float>(hits.t[i]) + 0.0f : kInfiniteDistance;  // no -0
      hit.u = hits.weight_v1[i], hit.v = hits.weight_v2[i];
      hit.instance_index = hits.instance[i], hit.primitive_index = hits.primitive[i];
    }
  }
}

// If triangles are smaller than the distance between rays, a packet's rays diverge long before they reach a leaf, and
// the stream is faster. After a packet where more than half of the rays finished alone, kPassedOver packets are left to
// the stream. After each further one, this number is doubled and increased by one, as the rays ahead probably diverge
// too.
constexpr unsigned kPassedOver = 7, kMostPassedOver = 63;

// Returns those of `rays` whose time is within the shutter.
inline RaySet in_shutter(const Packet& packet, RaySet rays) noexcept {
  for (RaySet left = rays; left != 0; left &= left - 1) {
    if (!is_in_shutter(packet.rays[first_ray(left)]->time)) rays &= ~(left & -left);
  }
  return rays;
}

template <bool kAny, bool kMoves>
void trace_packets(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left) noexcept {
  Packet& packet = *static_cast<Packet*>(workspace);
  std::uint32_t* const stack = reinterpret_cast<std::uint32_t*>(&packet + 1);
  const std::size_t entries = packet_stack_entries(scene);
  packet.slot = reinterpret_cast<Slot*>(stack + 4 * entries);
  packet.stack = {stack, reinterpret_cast<float*>(stack + entries), stack + 2 * entries, stack + 3 * entries};
  Pace pace(scene.interruption);
  packet.scene = &scene, packet.pace = &pace;
  packet.cull = batch.cull;
  const InstanceView* lone = lone_instance(scene);
  if (kMoves && lone != nullptr && lone->motion != 0) lone = nullptr;
  unsigned passed_over = 0, next_passed_over = kPassedOver;
  for (std::size_t begin = 0; begin < batch.count; begin += kPacketRays) {
    packet.count = static_cast<unsigned>(batch.count - begin < kPacketRays ? batch.count - begin : kPacketRays);
    packet.lanes = (packet.count + kRayLanes - 1) / kRayLanes * kRayLanes;
    bool* const is_left = left != nullptr ? left + begin / kPacketRays : nullptr;
    if (is_left != nullptr && (*is_left = passed_over != 0 || !may_be_coherent(batch, begin, packet.count))) {
      if (passed_over != 0) --passed_over;
      continue;
    }
    RaySet valid = 0;
    const bool is_direct = load_packet(packet, scene, lone, batch, begin, valid);
    const PacketRays& rays = is_direct ? packet.local_rays : packet.world_rays;
    if (is_left != nullptr && (*is_left = !are_coherent<kAny>(rays, valid, packet.lanes, scene.extent.reach))) continue;
    packet.alone = 0;
    if constexpr (kMoves) valid = in_shutter(packet, valid);
    PacketWalk<kAny, kMoves> walk{packet, scene, batch};
    if (is_direct) {
      walk.trace_directly(*lone, valid);
    } else {
      walk.trace(valid);
    }
    if (is_left != nullptr) {
      const bool diverged = 2 * packet.alone > packet.count;
      passed_over = diverged ? next_passed_over : 0;
      next_passed_over = !diverged                            ? kPassedOver
                         : next_passed_over < kMostPassedOver ? 2 * next_passed_over + 1
                                                              : kMostPassedOver;
    }
    if constexpr (!kAny) divide_weights(packet);
    write_results<kAny>(packet, batch);
  }
}

template <bool kAny>
void trace_in_packets(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left) {
  (scene.motions != nullptr ? trace_packets<kAny, true> : trace_packets<kAny, false>)(scene, batch, workspace, left);
}

}  // namespace
}  // namespace perfect_bvh
