// Tests a leaf against a packet's rays. If many rays of a vector enter the leaf, lanes are rays and the triangles come
// one at a time; otherwise lanes are triangles and the rays come one at a time. In both cases the arithmetic is that of
// math/triangle.h, operation by operation, so the bits are the same.
// Part of packet_kernel.inl: everything has internal linkage.

// The tree that a packet traverses, for rays of one key.
struct PacketLevel {
  const WideNode* nodes;
  const LeafBlock* blocks;  // null: the tree is over curves or points
  PacketBoxes* boxes;
  PacketBounds bounds;
  RaySet members;
  PacketKey key;
  const InstanceView* instance;
  std::uint32_t instance_index;
  bool shares_origin;  // all rays begin at the same point:
  double exact_origin[3];
  float shared_origin[3];
  bool is_direct;  // local t is the ray's own t, for all rays
};

// One ray of a packet in the form that single-ray kernels use.
struct LoneRay {
  BoxState box;
  TriangleState triangle;

  LoneRay(const Packet& packet, const PacketLevel& level, unsigned i) noexcept {
    const PacketBoxes& boxes = *level.boxes;
    const PacketRays& rays = packet.local_rays;
    for (int axis = 0; axis < 3; ++axis) {
      box.slab.inverse[axis] = boxes.inverse[axis][i];
      box.slab.near_offset[axis] = boxes.near_offset[axis][i];
      box.slab.far_offset[axis] = boxes.far_offset[axis][i];
      triangle.ray.axes[axis] = level.key.axes[axis];
      triangle.ray.origin[axis] = rays.narrow_origin[level.key.axes[axis]][i];
      triangle.row[axis] = static_cast<std::uint16_t>(32 * level.key.axes[axis]);
    }
    box.t_min = boxes.t_min[i], box.t_limit = boxes.t_limit[i];
    box.rows = level.key.rows;
    triangle.ray.shear_x = packet.triangles.shear_x[i], triangle.ray.shear_y = packet.triangles.shear_y[i];
    triangle.ray.direction_z = rays.narrow_direction[level.key.axes[2]][i];
    triangle.ray.depth_slack = packet.triangles.depth_slack[i];
    triangle.ray.edge_slack = packet.triangles.edge_slack[i];
    triangle.ray.runs_down = level.key.runs_down;
    set_depths(triangle, box.t_min, box.t_limit);
  }
};

// Takes a hit of ray i with a triangle at t, in the ray's own terms. Returns true if it is the best hit now.
PERFECT_BVH_INLINE bool take_packet_hit(Packet& packet, const PacketLevel& level, unsigned i, std::uint32_t primitive,
                                        const Meeting& meeting) noexcept {
  PacketHits& hits = packet.hits;
  const double t = meeting.t;
  if (!(is_in_range(t, *packet.rays[i]) && t <= hits.t[i])) return false;
  if (t == hits.t[i] && hits.instance[i] != kNoHit &&
      !wins_tie(packet.scene->instances, level.instance_index, primitive, hits.instance[i], hits.primitive[i])) {
    return false;
  }
  hits.t[i] = t;
  hits.weight_v1[i] = meeting.weight_v1, hits.weight_v2[i] = meeting.weight_v2, hits.weight_sum[i] = meeting.sum;
  hits.instance[i] = level.instance_index, hits.primitive[i] = primitive;
  return true;
}

// After a hit of ray i: any-hit rays need no more, others none that is farther.
template <bool kAny>
PERFECT_BVH_INLINE void limit_ray(Packet& packet, const PacketLevel& level, unsigned i,
                                  const TimeFrame& time) noexcept {
  level.boxes->t_limit[i] = kAny ? kDead : to_local_max(time, packet.hits.t[i]);
  if (kAny) packet.occluded |= RaySet{1} << i;
}

// Tests ray i against all triangles. Returns true if it has a new best hit (any hit: if there is a hit).
template <bool kAny>
bool test_leaf_alone(Packet& packet, const PacketLevel& level, const LeafBlock& leaf, unsigned i,
                     LoneRay& lone) noexcept {
  const LeafTest test = test_leaf(leaf, lone.triangle);
  if (test.lanes == 0) return false;
  const LeafCandidates candidates(test);
  const ObjectRay local = object_ray(packet.local_rays, i);
  bool is_new = false;
  for (unsigned lanes = test.lanes; lanes != 0; lanes &= lanes - 1) {
    const int lane = __builtin_ctz(lanes);
    Meeting meeting;
    if (!meet_candidate(meeting, candidates, lane, leaf, lone.triangle, local)) continue;
    if (is_culled(packet.cull, meeting.sum, lone.triangle.ray, level.instance->mirrored != 0)) continue;
    if (!take_packet_hit(packet, level, i, leaf.primitives[lane], meeting)) continue;
    is_new = true;
    if constexpr (kAny) break;
  }
  if (!is_new) return false;
  limit_ray<kAny>(packet, level, i, local.time);
  lone.box.t_limit = level.boxes->t_limit[i];
  set_depths(lone.triangle, lone.box.t_min, lone.box.t_limit);
  return true;
}

// Stores the vertices along the sheared frame's axes; relative to the rays' origin if they share it.
PERFECT_BVH_INLINE void store_vertices(float* x, float* y, float* z, const PacketLevel& level,
                                       const float (*rows)[8]) noexcept {
  float* const to[3] = {x, y, z};
  for (int k = 0; k < 3; ++k) {
    const Float8 row = load(rows[level.key.axes[k]]);
    store(to[k], level.shares_origin ? sub(row, broadcast(level.shared_origin[level.key.axes[k]])) : row);
  }
}

// The planes of triangles that some rays pass through, computed once for all rays.
struct LeafPlanes {
  TrianglePlane plane[8];
  double away[8];      // from the origin, if the rays share one
  unsigned known = 0;  // bits

  template <bool kShared>
  PERFECT_BVH_INLINE void make(const LeafBlock& leaf, unsigned triangle, const PacketLevel& level) noexcept {
    if ((known >> triangle & 1) != 0) return;
    const LoneCorners lone(leaf, static_cast<int>(triangle));
    plane[triangle] = plane_of(lone.at[0], lone.at[1], lone.at[2]);
    if constexpr (kShared) away[triangle] = plane_away(plane[triangle], level.exact_origin);
    known |= 1u << triangle;
  }
};

// A leaf's vertices, in the form that packets read.
struct LeafCorners {
  alignas(32) float x[8], y[8], z[8];
  alignas(32) std::uint32_t corners[3][8];
  LeafPlanes planes;
  unsigned triangle_count;

  LeafCorners(const PacketLevel& level, const LeafBlock& block) noexcept {
    store_vertices(x, y, z, level, block.vertices);
    for (unsigned i = 0; i < 8; ++i) {
      for (unsigned corner = 0; corner < 3; ++corner) corners[corner][i] = block.corners[i] >> 4 * corner & 7;
    }
    triangle_count = count_triangles(block.primitives);
  }
};

// Takes the hits of rays in `found` with a triangle, where local t is not the rays' own t. Returns the rays that need
// no more hits.
template <bool kAny>
unsigned take_moved_hits(Packet& packet, const PacketLevel& level, std::uint32_t primitive, unsigned first,
                         unsigned found, RayFloat t, RayFloat weight1, RayFloat weight2, RayFloat sum) noexcept {
  alignas(64) float t_of[kRayLanes], weights_v1[kRayLanes], weights_v2[kRayLanes], sums[kRayLanes];
  store_rays(t_of, t), store_rays(weights_v1, weight1), store_rays(weights_v2, weight2), store_rays(sums, sum);
  unsigned done = 0;
  for (; found != 0; found &= found - 1) {
    const int lane = __builtin_ctz(found);
    const unsigned i = first + static_cast<unsigned>(lane);
    const TimeFrame time = packet.local_rays.time(i);
    const Meeting meeting{to_ray_t(time, t_of[lane]), weights_v1[lane], weights_v2[lane], sums[lane]};
    if (!take_packet_hit(packet, level, i, primitive, meeting)) continue;
    limit_ray<kAny>(packet, level, i, time);
    done |= kAny ? 1u << lane : 0u;
  }
  return done;
}

// Computes t of a triangle's plane for the rays from `first` on, as plane_t() does, rounded to float.
template <bool kShared>
PERFECT_BVH_INLINE RayFloat plane_ts(const LeafPlanes& planes, unsigned triangle, const PacketRays& rays,
                                     unsigned first) noexcept {
  const TrianglePlane& plane = planes.plane[triangle];
  RayDouble normal[3];
  for (int axis = 0; axis < 3; ++axis) normal[axis] = every_ray(plane.normal[axis]);
  alignas(64) double t[kRayLanes];
  for (unsigned half = 0; half < kRayLanes; half += kDoubleLanes) {
    RayDouble away[3], along[3];
    for (int axis = 0; axis < 3; ++axis) {
      along[axis] = mul(normal[axis], load_rays(rays.direction[axis] + first + half));
      if constexpr (kShared) continue;
      const RayDouble origin = load_rays(rays.origin[axis] + first + half);
      away[axis] = mul(normal[axis], sub(every_ray(plane.point[axis]), origin));
    }
    const RayDouble speed = add(add(along[0], along[1]), along[2]);
    if constexpr (kShared) {
      store_rays(t + half, div(every_ray(planes.away[triangle]), speed));
    } else {
      store_rays(t + half, div(add(add(away[0], away[1]), away[2]), speed));
    }
  }
  return load_narrowed(t);
}

// The rays from `first` on pass through a triangle. Returns those whose t is in range for any point between the depths
// of its corners, like is_surely_in_range().
PERFECT_BVH_INLINE unsigned surely_in_range(const Packet& packet, const PacketLevel& level, unsigned first, RayFloat a,
                                            RayFloat b, RayFloat c) noexcept {
  const RayFloat inverse = load_rays(level.boxes->inverse[level.key.axes[2]] + first);
  const RayFloat least = min(min(a, b), c), most = max(max(a, b), c);
  const RayFloat slack = load_rays(packet.triangles.depth_slack + first), margin = add(slack, slack);
  const RayFloat begin = sub(mul(level.key.runs_down ? most : least, inverse), margin);
  const RayFloat end = add(mul(level.key.runs_down ? least : most, inverse), margin);
  return bits(less_equal(load_rays(level.boxes->t_min + first), begin)) &
         bits(less_equal(end, load_rays(level.boxes->t_limit + first)));
}

// Tests the rays in `lanes`, counted from `first` on, against all triangles, one at a time. Takes the hits that surely
// count. Returns the rays whose hits need a closer test (near an edge, or as far as the best hit).
template <bool kAny, bool kShared>
unsigned test_triangles(Packet& packet, const PacketLevel& level, const LeafBlock& block, LeafCorners& leaf,
                        unsigned first, unsigned lanes) noexcept {
  const PacketTriangles& triangles = packet.triangles;
  const PacketRays& rays = packet.local_rays;
  const std::uint8_t* const axes = level.key.axes;
  PacketHits& hits = packet.hits;
  float* const limits = level.boxes->t_limit + first;
  RayFloat across[8], upward[8], depth[8];
  const RayFloat shear_x = load_rays(triangles.shear_x + first), shear_y = load_rays(triangles.shear_y + first);
  // Converts a vertex: relative to the rays' origins, along the sheared frame's axes.
  const auto place = [&](unsigned i) __attribute__((always_inline)) {
    const RayFloat x = every_ray(leaf.x[i]), y = every_ray(leaf.y[i]), z = every_ray(leaf.z[i]);
    if constexpr (kShared) {
      depth[i] = z;
      across[i] = fnmadd(shear_x, depth[i], x);
      upward[i] = fnmadd(shear_y, depth[i], y);
    } else {
      depth[i] = sub(z, load_rays(rays.narrow_origin[axes[2]] + first));
      across[i] = fnmadd(shear_x, depth[i], sub(x, load_rays(rays.narrow_origin[axes[0]] + first)));
      upward[i] = fnmadd(shear_y, depth[i], sub(y, load_rays(rays.narrow_origin[axes[1]] + first)));
    }
  };
  for (unsigned i = 0; i < 8; ++i) place(i);
  const auto take_any = [&](unsigned found) __attribute__((always_inline)) {  // these rays need no more hits
    packet.occluded |= from_bits(found, first);
    store_some(limits, ray_mask(found), every_ray(kDead));
    lanes &= ~found;
  };
  const RayFloat none = every_ray(0.0f);
  const unsigned turned = level.key.runs_down != (level.instance->mirrored != 0) ? ~0u : 0u;
  unsigned ambiguous = 0;
  const RayFloat edge_slack = load_rays(triangles.edge_slack + first);
  const float span = span_bound(block);
  const RayFloat slack = mul(edge_slack, add(every_ray(span), edge_slack)), grazed = every_ray(grazing_sum(span));
  for (unsigned i = 0; i < leaf.triangle_count; ++i) {
    const unsigned a = leaf.corners[0][i], b = leaf.corners[1][i], c = leaf.corners[2][i];
    const RayFloat weight0 = difference(across[c], upward[b], upward[c], across[b]);
    const RayFloat weight1 = difference(across[a], upward[c], upward[a], across[c]);
    const RayFloat weight2 = difference(across[b], upward[a], upward[b], across[a]);
    const RayFloat least = min(min(weight0, weight1), weight2), most = max(max(weight0, weight1), weight2);
    const RayFloat least_weight = max(least, sub(none, most));
    const unsigned near = bits(less_equal(sub(none, slack), least_weight)) & lanes;
    if (near == 0) continue;
    unsigned inside = near & bits(less(slack, least_weight));
    ambiguous |= near & ~inside;
    const RayFloat sum = add(add(weight0, weight1), weight2);
    if (packet.cull == Cull::kBack) inside &= bits(less(none, sum)) ^ turned;
    if (inside == 0) continue;
    if constexpr (kAny) {
      const unsigned found =
          level.is_direct ? inside & surely_in_range(packet, level, first, depth[a], depth[b], depth[c]) : 0;
      if (found != 0) take_any(found);
      inside &= ~found;
      if (inside == 0) continue;
    }
    leaf.planes.template make<kShared>(block, i, level);
    const RayFloat t = plane_ts<kShared>(leaf.planes, i, rays, first);
    const RayFloat limit = load_rays(limits);
    const unsigned from = bits(less_equal(load_rays(level.boxes->t_min + first), t));
    const unsigned up_to = bits(less_equal(t, limit)), before = bits(less(t, limit));
    if (!level.is_direct) {
      const unsigned grazing = inside & bits(less_equal(max(sum, sub(none, sum)), grazed));
      ambiguous |= grazing;
      const unsigned found = inside & ~grazing & from & up_to;
      if (found == 0) continue;
      lanes &= ~take_moved_hits<kAny>(packet, level, block.primitives[i], first, found, t, weight1, weight2, sum);
      continue;
    }
    ambiguous |= inside & from & up_to & ~before;
    const unsigned found = inside & from & before;
    if (found == 0) continue;
    if constexpr (kAny) {
      take_any(found);
    } else {
      const RayMask mask = ray_mask(found);
      store_some(hits.instance + first, mask, level.instance_index);
      store_some(limits, mask, t);
      store_some(hits.t + first, mask, t);
      store_some(hits.weight_v1 + first, mask, weight1);
      store_some(hits.weight_v2 + first, mask, weight2);
      store_some(hits.weight_sum + first, mask, sum);
      store_some(hits.primitive + first, mask, block.primitives[i]);
    }
  }
  return kAny ? ambiguous & lanes : ambiguous;
}

// If a vector has at most this many rays in a leaf, they are tested one at a time.
constexpr unsigned kFewInLeaf = kRayLanes / 8;

template <bool kAny>
PERFECT_BVH_INLINE void test_leaf_together(Packet& packet, PacketLevel& level, const LeafBlock& leaf,
                                           const PacketBox& box, unsigned begin) noexcept {
  RaySet entered = entering(*level.boxes, box, begin, packet.lanes);
  if (entered == 0) return;
  LeafCorners corners(level, leaf);
  while (entered != 0) {
    const unsigned first = first_ray(entered) / kRayLanes * kRayLanes;
    unsigned lanes = lanes_of(entered, first);
    entered &= ~from_bits(lanes, first);
    if (count_bits(lanes) > kFewInLeaf) {
      lanes = level.shares_origin ? test_triangles<kAny, true>(packet, level, leaf, corners, first, lanes)
                                  : test_triangles<kAny, false>(packet, level, leaf, corners, first, lanes);
    }
    for (; lanes != 0; lanes &= lanes - 1) {
      const unsigned i = first + static_cast<unsigned>(__builtin_ctz(lanes));
      LoneRay lone(packet, level, i);
      test_leaf_alone<kAny>(packet, level, leaf, i, lone);
    }
  }
  level.bounds.t_limit = highest_limit(packet, *level.boxes);
}

// Tests ray i against the curves or points of a leaf. Returns true if it has a new best hit (any hit: if there is a
// hit).
template <bool kAny>
__attribute__((noinline)) bool test_round_leaf_alone(Packet& packet, const PacketLevel& level, std::uint32_t row,
                                                     unsigned i) noexcept {
  const RoundLeaves& leaves = *level.instance->leaves.round_leaves;
  ObjectRay local;  // without its time, which only candidates need
  for (int axis = 0; axis < 3; ++axis) {
    local.origin[axis] = packet.local_rays.origin[axis][i],
    local.direction[axis] = packet.local_rays.direction[axis][i];
  }
  local.origin[3] = local.direction[3] = 0.0;
  PacketBoxes& boxes = *level.boxes;
  PacketHits& hits = packet.hits;
  const RoundCandidates candidates(leaves, row, local, boxes.t_min[i], boxes.t_limit[i], level.instance->extent.reach);
  if (candidates.lanes == 0) return false;
  const RoundRay ray = round_ray(local.origin, local.direction);
  const TimeFrame time = packet.local_rays.time(i);
  bool is_new = false;
  for (unsigned lanes = candidates.lanes; lanes != 0 && !(kAny && is_new); lanes &= lanes - 1) {
    const std::uint32_t primitive = candidates.primitives[__builtin_ctz(lanes)];
    const auto counts = [&](double t) {
      if (!(is_in_range(t, *packet.rays[i]) && t <= hits.t[i])) return false;
      return !(t == hits.t[i] && hits.instance[i] != kNoHit) ||
             wins_tie(packet.scene->instances, level.instance_index, primitive, hits.instance[i], hits.primitive[i]);
    };
    RoundHit hit;
    if (!meet_end(hit, ray, leaves.round, primitive, time, packet.cull, counts)) continue;
    is_new = true;
    hits.t[i] = hit.t;
    hits.weight_v1[i] = hit.u, hits.weight_v2[i] = 0.0f, hits.weight_sum[i] = 1.0f;
    hits.instance[i] = level.instance_index, hits.primitive[i] = primitive;
  }
  if (is_new) limit_ray<kAny>(packet, level, i, time);
  return is_new;
}

// Tests one ray after another: rays do not stay together from hair to hair.
template <bool kAny>
__attribute__((noinline)) void test_round_leaf_together(Packet& packet, PacketLevel& level, std::uint32_t row,
                                                        const PacketBox& box, unsigned begin) noexcept {
  for (unsigned first = begin; first < packet.lanes; first += kRayLanes) {
    unsigned lanes = test_box(*level.boxes, box, first);
    for (; lanes != 0; lanes &= lanes - 1) {
      test_round_leaf_alone<kAny>(packet, level, row, first + static_cast<unsigned>(__builtin_ctz(lanes)));
    }
  }
  level.bounds.t_limit = highest_limit(packet, *level.boxes);
}

// Tests the rays from `begin` on that enter `box` against everything in a leaf.
template <bool kAny>
void visit_packet_leaf(Packet& packet, PacketLevel& level, std::uint32_t row, const PacketBox& box,
                       unsigned begin) noexcept {
  if (level.blocks == nullptr) return test_round_leaf_together<kAny>(packet, level, row, box, begin);
  test_leaf_together<kAny>(packet, level, level.blocks[row], box, begin);
}

template <bool kAny>
__attribute__((noinline)) bool visit_round_leaf_alone(Packet& packet, const PacketLevel& level, std::uint32_t row,
                                                      unsigned i, LoneRay& lone) noexcept {
  if (!test_round_leaf_alone<kAny>(packet, level, row, i)) return false;
  lone.box.t_limit = level.boxes->t_limit[i];
  return true;
}

// Like test_leaf_alone.
template <bool kAny>
PERFECT_BVH_INLINE bool visit_leaf_alone(Packet& packet, const PacketLevel& level, std::uint32_t row, unsigned i,
                                         LoneRay& lone) noexcept {
  if (level.blocks == nullptr) return visit_round_leaf_alone<kAny>(packet, level, row, i, lone);
  return test_leaf_alone<kAny>(packet, level, level.blocks[row], i, lone);
}
