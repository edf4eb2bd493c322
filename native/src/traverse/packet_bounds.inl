// Bounds all rays of a packet at once: intervals of their reciprocal directions, seen from one ray's origin (interval
// arithmetic on packets: Boulos et al. 2006, Wald et al. 2007). One test of a node's eight boxes against the bounds
// rejects those that no ray can enter. For a ray r and any point c,
//   near_r = p * inv_r - near_offset_r = (p - c) * inv_r - (near_offset_r - c * inv_r),
// which is least at an end of the interval of inv_r. The margin exceeds the rounding of both sides: each is within
// 2^-24 of products of at most (M + |c|) * |inv|, with M as in math/slab.h, and of the offsets.
// Part of packet_kernel.inl: everything has internal linkage.

struct PacketBounds {
  float origin[3];
  float least_inverse[3], most_inverse[3];
  float near_offset[3], far_offset[3];
  float t_min, t_limit;
};

PERFECT_BVH_INLINE float smallest(RayFloat a) noexcept { return -largest(sub(every_ray(-0.0f), a)); }

// Returns the highest limit of all rays; nothing beyond it matters.
PERFECT_BVH_INLINE float highest_limit(const Packet& packet, const PacketBoxes& boxes) noexcept {
  RayFloat most = load_rays(boxes.t_limit);
  for (unsigned i = kRayLanes; i < packet.lanes; i += kRayLanes) most = max(most, load_rays(boxes.t_limit + i));
  return largest(most);
}

inline void set_bounds(PacketBounds& bounds, const Packet& packet, const PacketBoxes& boxes, RaySet rays,
                       const PacketRays& frame, const TreeExtent& extent) noexcept {
  const unsigned first = first_ray(rays);
  for (int axis = 0; axis < 3; ++axis) {
    const float centre = frame.narrow_origin[axis][first];
    // Rays outside the set are replaced by the first ray.
    const RayFloat c = every_ray(centre), stand_in = every_ray(boxes.inverse[axis][first]);
    const RayFloat near_in = every_ray(boxes.near_offset[axis][first]);
    const RayFloat far_in = every_ray(boxes.far_offset[axis][first]);
    RayFloat least = stand_in, most = stand_in;
    RayFloat near_most = fnmadd(c, stand_in, near_in), far_least = fnmadd(c, stand_in, far_in);
    for (unsigned i = 0; i < packet.lanes; i += kRayLanes) {
      const RayMask mask = ray_mask(lanes_of(rays, i));
      const RayFloat inverse = select(mask, load_rays(boxes.inverse[axis] + i), stand_in);
      const RayFloat near = select(mask, load_rays(boxes.near_offset[axis] + i), near_in);
      const RayFloat far = select(mask, load_rays(boxes.far_offset[axis] + i), far_in);
      least = min(least, inverse), most = max(most, inverse);
      near_most = max(near_most, fnmadd(c, inverse, near));
      far_least = min(far_least, fnmadd(c, inverse, far));
    }
    const float low = smallest(least), high = largest(most);
    const float near = largest(near_most), far = smallest(far_least);
    const float steepest = larger(magnitude(low), magnitude(high));
    const float margin =
        0x1p-20f * ((extent.largest[axis] + magnitude(centre)) * steepest + larger(magnitude(near), magnitude(far)));
    bounds.origin[axis] = centre;
    bounds.least_inverse[axis] = low, bounds.most_inverse[axis] = high;
    bounds.near_offset[axis] = near + margin, bounds.far_offset[axis] = far - margin;
  }
  const RayFloat none = every_ray(kInfiniteDistance);
  RayFloat t_min = none;
  for (unsigned i = 0; i < packet.lanes; i += kRayLanes) {
    t_min = min(t_min, select(ray_mask(lanes_of(rays, i)), load_rays(boxes.t_min + i), none));
  }
  bounds.t_min = smallest(t_min);
  bounds.t_limit = highest_limit(packet, boxes);
}

// `near`: no ray enters earlier.
PERFECT_BVH_INLINE NodeTest test_bounds(const WideNode& node, const OctantRows& rows,
                                        const PacketBounds& bounds) noexcept {
  Float8 near = broadcast(bounds.t_min), far = broadcast(bounds.t_limit);
  for (int axis = 0; axis < 3; ++axis) {
    const Float8 origin = broadcast(bounds.origin[axis]);
    const Float8 least = broadcast(bounds.least_inverse[axis]), most = broadcast(bounds.most_inverse[axis]);
    const Float8 near_offset = broadcast(bounds.near_offset[axis]), far_offset = broadcast(bounds.far_offset[axis]);
    const Float8 first = sub(load_row(&node, rows.near_row[axis]), origin);
    const Float8 last = sub(load_row(&node, rows.far_row[axis]), origin);
    near = max(near, min(fmsub(first, least, near_offset), fmsub(first, most, near_offset)));
    far = min(far, max(fmsub(last, least, far_offset), fmsub(last, most, far_offset)));
  }
  return {near, less_equal(near, far)};
}

// Packet coherence ----------------------------------------------------------------------------------------------------
// Decides whether the rays of a packet have similar paths, so that tracing them together pays off. The decision depends
// only on the rays.
// Part of packet_kernel.inl: everything has internal linkage.

// In measurements, packets were faster for camera and shadow rays, the stream for diffuse bounces. These limits
// separate the two.
constexpr float kMostSlope = 0.4f;   // between directions, across the longest axis of the first
constexpr float kMostShift = 0.05f;  // between origins along any axis, in the scene's reach
// Rays from far away were moved towards the scene one by one, even if they shared an origin. They are nearly parallel,
// so neighbours may be farther apart.
constexpr float kMostShiftMoved = 0.25f;
// Rays to a light begin on different surfaces, and in packets are faster even then.
constexpr float kMostShiftAny = 0.5f;
constexpr unsigned kLeastRays = 16;

PERFECT_BVH_INLINE bool are_alike(const Vec3d& a, const Vec3d& b) noexcept {
  const double along = a.x * b.x + a.y * b.y + a.z * b.z;
  const double squares = (a.x * a.x + a.y * a.y + a.z * a.z) * (b.x * b.x + b.y * b.y + b.z * b.z);
  return along > 0.0 && along * along > 0.75 * squares;
}

// Checks the directions of a few rays, which detects most incoherent packets before they are loaded.
PERFECT_BVH_INLINE bool may_be_coherent(const RayBatch& batch, std::size_t begin, unsigned count) noexcept {
  if (count < kLeastRays) return false;
  const auto direction = [&](unsigned i) -> const Vec3d& { return batch.rays[row_of(batch, begin + i)].direction; };
  const Vec3d& first = direction(0);
  return are_alike(first, direction(count - 1)) && are_alike(first, direction(count / 2)) &&
         are_alike(first, direction(count / 3));
}

// Checks all rays of `valid`, as the top level sees them.
template <bool kAny>
bool are_coherent(const PacketRays& rays, RaySet valid, unsigned lanes, float reach) noexcept {
  if (count_rays(valid) < kLeastRays) return false;
  const unsigned first = first_ray(valid);
  const int k = rays.longest[0] >> first & 1 ? 0 : rays.longest[1] >> first & 1 ? 1 : 2;
  const RayFloat first_along = every_ray(rays.narrow_direction[k][first]);
  const float shift_share = kAny ? kMostShiftAny : (rays.moved & valid) != 0 ? kMostShiftMoved : kMostShift;
  const RayFloat most_shift = every_ray(shift_share * reach), none = every_ray(0.0f);
  RaySet alike = 0;
  for (unsigned i = 0; i < lanes; i += kRayLanes) {
    const RayFloat along = load_rays(rays.narrow_direction[k] + i), product = mul(along, first_along);
    const RayFloat most_slope = mul(every_ray(kMostSlope), product);
    RayMask same = less(none, product);
    for (int axis = 0; axis < 3; ++axis) {
      const RayFloat across = mul(load_rays(rays.narrow_direction[axis] + i), first_along);
      const RayFloat slope = fnmadd(every_ray(rays.narrow_direction[axis][first]), along, across);
      const RayFloat shift = sub(load_rays(rays.narrow_origin[axis] + i), every_ray(rays.narrow_origin[axis][first]));
      same = both(same, both(less_equal(abs(slope), most_slope), less_equal(abs(shift), most_shift)));
    }
    alike |= from_bits(bits(same), i);
  }
  return (valid & ~alike) == 0;
}
