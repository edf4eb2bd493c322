// The state of up to 64 rays that traverse a tree together: constants, limits and best hits. Each quantity has one
// array, so that a vector holds the same quantity of neighbouring rays.
// Part of packet_kernel.inl: everything has internal linkage.

constexpr float kDead = -kInfiniteDistance;  // as the limit of t: a ray that enters no box
using RaySet = std::uint64_t;                // bit i: ray i of the packet

PERFECT_BVH_INLINE unsigned first_ray(RaySet rays) noexcept { return static_cast<unsigned>(__builtin_ctzll(rays)); }
PERFECT_BVH_INLINE unsigned count_rays(RaySet rays) noexcept {
  return static_cast<unsigned>(__builtin_popcountll(rays));
}
PERFECT_BVH_INLINE RaySet from_bits(unsigned lanes, unsigned first) noexcept { return RaySet{lanes} << first; }
PERFECT_BVH_INLINE unsigned lanes_of(RaySet rays, unsigned first) noexcept {
  return static_cast<unsigned>(rays >> first) & ((1u << kRayLanes) - 1);
}

// The constants of one level, like BoxState.
struct alignas(64) PacketBoxes {
  float inverse[3][kPacketRays], near_offset[3][kPacketRays], far_offset[3][kPacketRays];
  float t_min[kPacketRays], t_limit[kPacketRays];
};

// Like TriangleRay; the rest of it is in PacketRays.
struct alignas(64) PacketTriangles {
  float shear_x[kPacketRays], shear_y[kPacketRays], depth_slack[kPacketRays], edge_slack[kPacketRays];
};

struct alignas(64) PacketHits {
  double t[kPacketRays];  // in the ray's own terms; last_t(t_max) before the first hit
  float weight_v1[kPacketRays], weight_v2[kPacketRays], weight_sum[kPacketRays];
  std::uint32_t instance[kPacketRays], primitive[kPacketRays];
};

// The children waiting to be visited, in parallel arrays of `capacity` entries each.
struct PacketStack {
  std::uint32_t* children;
  float* nears;            // no ray enters earlier
  std::uint32_t* parents;  // row of the node that holds the child's box
  std::uint32_t* places;   // bits 0-2: slot in that node; the rest: the first ray that may enter
};

// Like ObjectRay, for the rays that need no shift or scale (see ray.h); `moved` has the others.
struct alignas(64) PacketRays {
  double origin[3][kPacketRays], direction[3][kPacketRays];
  float narrow_origin[3][kPacketRays], narrow_direction[3][kPacketRays];
  RaySet moved;
  TimeFrame moved_time[kPacketRays];
  double start[3][kPacketRays];  // of the moved rays: their origin before the move
  // By direction: the rays that run down each axis, and those for which it is the longest.
  RaySet down[3], longest[3];

  [[nodiscard]] TimeFrame time(unsigned i) const noexcept {
    return moved >> i & 1 ? moved_time[i] : TimeFrame{0.0, 1.0, true};
  }
};

struct Packet {
  const Ray* rays[kPacketRays];
  std::uint32_t rows[kPacketRays];  // in the batch
  const SceneView* scene;
  Pace* pace;
  Cull cull;
  unsigned count;             // rays
  unsigned lanes;             // `count` rounded up to whole vectors
  std::uint32_t common_mask;  // the bits that all rays share
  unsigned alone;             // times that a ray was traced alone, or entered an instance with few others
  PacketStack stack;
  Slot* slot;  // for rays that go alone, in a scene in which something moves
  alignas(64) float t_min[kPacketRays], t_max[kPacketRays];  // of the rays themselves
  PacketRays world_rays, local_rays;
  PacketBoxes world, local;
  PacketTriangles triangles;
  PacketHits hits;
  RaySet occluded;  // any hit: the rays that have a hit
};

// The planes of a box, in the order in which rays of one octant pass them. `box` points to its lower x in its node's
// planes.
struct PacketBox {
  RayFloat near[3], far[3];

  PERFECT_BVH_INLINE PacketBox(const OctantRows& rows, const float* box) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      near[axis] = every_ray(box[rows.near_row[axis] / 4]), far[axis] = every_ray(box[rows.far_row[axis] / 4]);
    }
  }
};

// Tests a vector of rays against one box; returns the rays that enter it.
PERFECT_BVH_INLINE unsigned test_box(const PacketBoxes& rays, const PacketBox& box, unsigned first) noexcept {
  RayFloat near = load_rays(rays.t_min + first), far = load_rays(rays.t_limit + first);
  for (int axis = 0; axis < 3; ++axis) {
    const RayFloat inverse = load_rays(rays.inverse[axis] + first);
    near = max(fmsub(box.near[axis], inverse, load_rays(rays.near_offset[axis] + first)), near);
    far = min(fmsub(box.far[axis], inverse, load_rays(rays.far_offset[axis] + first)), far);
  }
  return bits(less_equal(near, far));
}

// Returns the rays from `first` on that enter a box.
PERFECT_BVH_INLINE RaySet entering(const PacketBoxes& rays, const PacketBox& box, unsigned first,
                                   unsigned lanes) noexcept {
  RaySet entered = 0;
  for (; first < lanes; first += kRayLanes) entered |= from_bits(test_box(rays, box, first), first);
  return entered;
}

// Packet setup --------------------------------------------------------------------------------------------------------
// Computes the constants of a packet at one level from its rays: the operations of isa_avx.h, a vector of rays at a
// time.
// Part of packet_kernel.inl: everything has internal linkage.

constexpr unsigned kDoubleLanes = kRayLanes / 2;

inline ObjectRay object_ray(const PacketRays& rays, unsigned i) noexcept {
  ObjectRay ray;
  for (int axis = 0; axis < 3; ++axis) {
    ray.origin[axis] = rays.origin[axis][i], ray.direction[axis] = rays.direction[axis][i];
  }
  ray.origin[3] = ray.direction[3] = 0.0;
  ray.time = rays.time(i);
  if (!ray.time.is_direct) {
    for (int axis = 0; axis < 3; ++axis) ray.start[axis] = rays.start[axis][i];
  }
  return ray;
}

// Brings ray i near, if it is not. Returns false if it hits nothing.
inline bool move_ray(PacketRays& rays, unsigned i, double reach) noexcept {
  ObjectRay ray = object_ray(rays, i);
  for (const double component : ray.origin) {
    if (!(component - component == 0.0)) return false;
  }
  if (!bring_near(ray, reach)) return false;
  if (ray.time.is_direct) return true;
  for (int axis = 0; axis < 3; ++axis) {
    rays.origin[axis][i] = ray.origin[axis];
    rays.direction[axis][i] = ray.direction[axis];
    rays.start[axis][i] = ray.start[axis];
  }
  rays.moved |= RaySet{1} << i;
  rays.moved_time[i] = ray.time;
  return true;
}

// The rays that are surely near (see ray.h), and whether all are usual ones, as defined by load_near_by_axis().
// Compared in float, which is stricter: the limits of lengths are powers of two, and `farthest` is reduced by its
// rounding.
struct NearRays {
  RaySet near = 0;
  bool all_usual = true;
};

// Sets all that depends on the rays' origins and directions.
inline NearRays narrow_rays(PacketRays& rays, unsigned lanes, double farthest) noexcept {
  const RayFloat longest = every_ray(static_cast<float>(kLongest)), shortest = every_ray(static_cast<float>(kShortest));
  const RayFloat limit = every_ray(static_cast<float>(farthest) * (1.0f - 0x1p-22f));
  NearRays result;
  for (int axis = 0; axis < 3; ++axis) rays.down[axis] = rays.longest[axis] = 0;
  for (unsigned i = 0; i < lanes; i += kRayLanes) {
    RayFloat length[3], away[3];
    for (int axis = 0; axis < 3; ++axis) {
      const RayFloat direction = load_narrowed(rays.direction[axis] + i);
      const RayFloat origin = load_narrowed(rays.origin[axis] + i);
      store_rays(rays.narrow_direction[axis] + i, direction), store_rays(rays.narrow_origin[axis] + i, origin);
      rays.down[axis] |= from_bits(signs(direction), i);
      length[axis] = abs(direction), away[axis] = abs(origin);
    }
    const auto each = [](RayMask x, RayMask y, RayMask z) { return both(both(x, y), z); };
    const RayMask long_x = less(shortest, length[0]), long_y = less(shortest, length[1]);
    const RayMask long_z = less(shortest, length[2]);
    const RayMask moderate =
        both(each(less(length[0], longest), less(length[1], longest), less(length[2], longest)),
             each(less_equal(away[0], limit), less_equal(away[1], limit), less_equal(away[2], limit)));
    result.near |= from_bits(bits(both(moderate, either(either(long_x, long_y), long_z))), i);
    result.all_usual = result.all_usual && bits(both(moderate, each(long_x, long_y, long_z))) == (1u << kRayLanes) - 1;
    // Like longest_axis().
    const unsigned x_over_y = bits(less(length[1], length[0])), x_over_z = bits(less(length[2], length[0]));
    const unsigned y_over_z = bits(less(length[2], length[1]));
    const unsigned x = x_over_y & x_over_z, y = ~x_over_y & y_over_z;
    rays.longest[0] |= from_bits(x & ((1u << kRayLanes) - 1), i);
    rays.longest[1] |= from_bits(y & ((1u << kRayLanes) - 1), i);
  }
  rays.longest[2] = ~(rays.longest[0] | rays.longest[1]);
  return result;
}

// Moves those of `candidates` that are not near. Returns the remaining rays, near and narrowed.
inline RaySet prepare_rays(PacketRays& rays, RaySet candidates, unsigned lanes, double reach) noexcept {
  const RaySet far = candidates & ~narrow_rays(rays, lanes, kNearby * reach).near;
  for (RaySet left = far; left != 0; left &= left - 1) {
    if (!move_ray(rays, first_ray(left), reach)) candidates &= ~(left & -left);
  }
  if (far != 0) (void)narrow_rays(rays, lanes, kNearby * reach);
  return candidates;
}

// Loads the `packet.count` rays from `begin` on, not prepared yet. Omits rays that cannot hit anything.
inline RaySet load_rays_of(const RayBatch& batch, std::size_t begin, double scale, Packet& packet,
                           PacketRays& rays) noexcept {
  static_assert(offsetof(PacketRays, direction) == 3 * kPacketRays * sizeof(double));  // six columns in all
  static_assert(kRayLanes % 4 == 0);
  RaySet valid = 0;
  packet.common_mask = ~0u;
  for (unsigned i = 0; i < packet.lanes; ++i) {
    const std::size_t place = begin + (i < packet.count ? i : packet.count - 1);
    const std::size_t row = row_of(batch, place), next = place + kPacketRays;
    const Ray& ray = batch.rays[row];
    if (next < batch.count) __builtin_prefetch(&batch.rays[row_of(batch, next)]);
    packet.rays[i] = &ray, packet.rows[i] = static_cast<std::uint32_t>(row);
    packet.common_mask &= ray.mask;
  }
  for (unsigned i = 0; i < packet.lanes; i += 4) {
    load_columns(packet.rays + i, scale, rays.origin[0] + i, kPacketRays, packet.t_min + i, packet.t_max + i);
  }
  for (unsigned i = 0; i < packet.lanes; ++i) packet.hits.t[i] = last_t(packet.t_max[i]);
  for (unsigned i = 0; i < packet.lanes; i += kRayLanes) {
    valid |= from_bits(bits(less_equal(load_rays(packet.t_min + i), load_rays(packet.t_max + i))), i);
  }
  rays.moved = 0;
  return valid & (~RaySet{0} >> (kPacketRays - packet.count));
}

// Loads the next packet, prepared for the scene. Returns true if it can be traced directly through the lone instance:
// it is then in packet.local_rays, otherwise in packet.world_rays.
inline bool load_packet(Packet& packet, const SceneView& scene, const InstanceView* lone, const RayBatch& batch,
                        std::size_t begin, RaySet& valid) noexcept {
  const double scale = static_cast<double>(scene.scale), reach = static_cast<double>(scene.reach);
  if (lone != nullptr) {
    valid = load_rays_of(batch, begin, scale, packet, packet.local_rays);
    if (narrow_rays(packet.local_rays, packet.lanes, farthest_in_place(scene)).all_usual) return true;
  }
  valid = load_rays_of(batch, begin, scale, packet, packet.world_rays);
  valid = prepare_rays(packet.world_rays, valid, packet.lanes, reach);
  return false;
}

// Maps the original ray i to an instance, because it was moved for the top level.
inline void map_from_start(Packet& packet, unsigned i, const MapColumns& map) noexcept {
  ObjectRay world, local;
  load_ray(world, *packet.rays[i], static_cast<double>(packet.scene->scale));
  map_to_local(local, world, map);
  for (int axis = 0; axis < 3; ++axis) {
    packet.local_rays.origin[axis][i] = local.origin[axis];
    packet.local_rays.direction[axis][i] = local.direction[axis];
  }
}

// Maps `rays` to the instance's tree. Returns those that may hit something in it.
inline RaySet map_packet(Packet& packet, RaySet rays, const InstanceView& instance) noexcept {
  const PacketRays& from = packet.world_rays;
  PacketRays& to = packet.local_rays;
  const auto& map = instance.world_to_local;
  for (unsigned i = 0; i < packet.lanes; i += kDoubleLanes) {
    const RayDouble x = load_rays(from.origin[0] + i), dx = load_rays(from.direction[0] + i);
    const RayDouble y = load_rays(from.origin[1] + i), dy = load_rays(from.direction[1] + i);
    const RayDouble z = load_rays(from.origin[2] + i), dz = load_rays(from.direction[2] + i);
    for (int axis = 0; axis < 3; ++axis) {
      const RayDouble a = every_ray(map[0][axis]), b = every_ray(map[1][axis]), c = every_ray(map[2][axis]);
      const RayDouble linear = add(add(mul(a, x), mul(b, y)), mul(c, z));
      store_rays(to.origin[axis] + i, add(linear, every_ray(map[3][axis])));
      store_rays(to.direction[axis] + i, add(add(mul(a, dx), mul(b, dy)), mul(c, dz)));
    }
  }
  to.moved = 0;
  for (RaySet moved = from.moved & rays; moved != 0; moved &= moved - 1) map_from_start(packet, first_ray(moved), map);
  return prepare_rays(to, rays, packet.lanes, static_cast<double>(instance.extent.reach));
}

// The common properties of rays that are traced together.
struct PacketKey {
  OctantRows rows;
  std::uint8_t axes[3];  // of the sheared frame
  bool runs_down;        // the longest axis
};

// Returns the rays of `candidates` that run in the same octant, along the same longest axis, as the first of them.
inline RaySet of_one_key(const PacketRays& rays, RaySet candidates, PacketKey& key) noexcept {
  const unsigned first = first_ray(candidates);
  unsigned octant = 0, longest = 0;
  for (unsigned axis = 0; axis < 3; ++axis) {
    const unsigned down = rays.down[axis] >> first & 1;
    octant |= down << axis;
    candidates &= down != 0 ? rays.down[axis] : ~rays.down[axis];
    if (rays.longest[axis] >> first & 1) longest = axis;
  }
  constexpr std::uint8_t kAxes[5] = {1, 2, 0, 1, 2};
  key.rows = kOctantRows[octant];
  key.axes[0] = kAxes[longest], key.axes[1] = kAxes[longest + 1], key.axes[2] = static_cast<std::uint8_t>(longest);
  key.runs_down = (octant >> longest & 1) != 0;
  return candidates & rays.longest[longest];
}

// Does set_states() of isa_avx.h, for the vectors that contain any of `members`; undefined for rays of other keys.
inline void set_constants(PacketBoxes& boxes, PacketTriangles& triangles, const PacketRays& rays, RaySet members,
                          unsigned lanes, const PacketKey& key, const TreeExtent& extent) noexcept {
  const RayFloat one = every_ray(1.0f);
  const int k = key.axes[2];
  for (unsigned i = 0; i < lanes; i += kRayLanes) {
    if (lanes_of(members, i) == 0) continue;
    const RayFloat long_length = abs(load_rays(rays.narrow_direction[k] + i));
    const RayFloat smallest_length = mul(every_ray(kSmallestShare), long_length);
    const RayFloat long_reach = add(every_ray(extent.largest[k]), abs(load_rays(rays.narrow_origin[k] + i)));
    const RayFloat long_inverse = div(one, max(long_length, smallest_length));
    const RayFloat long_depth = mul(long_reach, long_inverse);
    const RayFloat share = mul(every_ray(kReachShare), long_reach);
    const RayFloat depth_slack = mul(every_ray(kDepthSlack), long_depth);
    RayFloat longest_reach = long_reach;
    for (int axis = 0; axis < 3; ++axis) {
      const RayFloat origin = load_rays(rays.narrow_origin[axis] + i);
      const RayFloat direction = load_rays(rays.narrow_direction[axis] + i);
      const RayFloat raised = with_sign(max(abs(direction), smallest_length), direction);
      const RayFloat inverse = axis == k ? with_sign(long_inverse, direction) : div(one, raised);
      const RayFloat reach = add(every_ray(extent.largest[axis]), abs(origin));
      const RayFloat slack = add(mul(every_ray(kPlaneSlack), mul(add(reach, share), abs(inverse))), depth_slack);
      longest_reach = max(longest_reach, reach);
      const RayFloat at_origin = mul(origin, inverse);
      store_rays(boxes.inverse[axis] + i, inverse);
      store_rays(boxes.near_offset[axis] + i, add(at_origin, slack));
      store_rays(boxes.far_offset[axis] + i, sub(at_origin, slack));
    }
    const RayFloat along = load_rays(rays.narrow_direction[k] + i);
    const RayFloat inverse = with_sign(long_inverse, along);
    store_rays(triangles.shear_x + i, mul(load_rays(rays.narrow_direction[key.axes[0]] + i), inverse));
    store_rays(triangles.shear_y + i, mul(load_rays(rays.narrow_direction[key.axes[1]] + i), inverse));
    store_rays(triangles.depth_slack + i, mul(every_ray(kDepthReach), long_depth));
    store_rays(triangles.edge_slack + i, mul(every_ray(kEdgeReach), longest_reach));
  }
}

// Sets the present range of t of `members`; other rays enter nothing. For any-hit, rays that have a hit enter nothing
// either.
template <bool kAny>
void set_ranges(PacketBoxes& boxes, const Packet& packet, const PacketRays& rays, RaySet members) noexcept {
  if (kAny) members &= ~packet.occluded;
  for (unsigned i = 0; i < packet.lanes; i += kRayLanes) {
    const RayFloat limit = load_narrowed(packet.hits.t + i);
    const RayMask mask = ray_mask(lanes_of(members, i));
    // Other rays get both ends of an empty range. Their constants may be NaN, so that only the range decides, and a
    // range from -infinity to kDead is not empty.
    store_rays(boxes.t_min + i, select(mask, load_rays(packet.t_min + i), every_ray(kInfiniteDistance)));
    store_rays(boxes.t_limit + i, select(mask, limit, every_ray(kDead)));
  }
  for (RaySet moved = rays.moved & members; moved != 0; moved &= moved - 1) {
    const unsigned i = first_ray(moved);
    boxes.t_min[i] = to_local_min(rays.moved_time[i], static_cast<double>(packet.t_min[i]));
    boxes.t_limit[i] = to_local_max(rays.moved_time[i], packet.hits.t[i]);
  }
}
