// Whether the rays of a packet go much the same way, so that tracing them together pays. Decided by the rays alone.
// Part of packet_kernel.inl: everything has internal linkage.

// Packets won for camera and shadow rays, the stream for diffuse bounces: these tell them apart.
constexpr float kMostSlope = 0.4f;   // between directions, across the longest axis of the first
constexpr float kMostShift = 0.05f;  // between origins along any axis, in the scene's reach
// Rays that come from far away were moved towards the scene, each by itself, even if they had one origin. They are as
// good as parallel: neighbours may stand further apart.
constexpr float kMostShiftMoved = 0.25f;
constexpr unsigned kLeastRays = 16;

PERFECT_BVH_INLINE bool are_alike(const Vec3d& a, const Vec3d& b) noexcept {
  const double along = a.x * b.x + a.y * b.y + a.z * b.z;
  const double squares = (a.x * a.x + a.y * a.y + a.z * a.z) * (b.x * b.x + b.y * b.y + b.z * b.z);
  return along > 0.0 && along * along > 0.75 * squares;
}

// A glance at the directions of a few rays, which tells most incoherent packets before they are loaded.
PERFECT_BVH_INLINE bool may_be_coherent(const RayBatch& batch, std::size_t begin, unsigned count) noexcept {
  if (count < kLeastRays) return false;
  const auto direction = [&](unsigned i) -> const Vec3d& { return batch.rays[row_of(batch, begin + i)].direction; };
  const Vec3d& first = direction(0);
  return are_alike(first, direction(count - 1)) && are_alike(first, direction(count / 2)) &&
         are_alike(first, direction(count / 3));
}

// All of `valid`, as the top level sees them.
inline bool are_coherent(const PacketRays& rays, RaySet valid, unsigned lanes, float reach) noexcept {
  if (count_rays(valid) < kLeastRays) return false;
  const unsigned first = first_ray(valid);
  const int k = rays.longest[0] >> first & 1 ? 0 : rays.longest[1] >> first & 1 ? 1 : 2;
  const RayFloat first_along = every_ray(rays.narrow_direction[k][first]);
  const float shift_share = (rays.moved & valid) != 0 ? kMostShiftMoved : kMostShift;
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
