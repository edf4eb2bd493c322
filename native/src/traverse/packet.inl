// Up to 64 rays that go through a tree together: their constants, limits and best hits, one array a quantity, so that
// a vector holds the same quantity of neighbouring rays.
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

// Of one level: as BoxState.
struct alignas(64) PacketBoxes {
  float inverse[3][kPacketRays], near_offset[3][kPacketRays], far_offset[3][kPacketRays];
  float t_min[kPacketRays], t_limit[kPacketRays];
};

// As TriangleRay; the rest of it is in PacketRays.
struct alignas(64) PacketTriangles {
  float shear_x[kPacketRays], shear_y[kPacketRays], depth_slack[kPacketRays], edge_slack[kPacketRays];
};

struct alignas(64) PacketHits {
  double t[kPacketRays];  // in the ray's own terms; last_t(t_max) before the first hit
  float weight_v1[kPacketRays], weight_v2[kPacketRays], weight_sum[kPacketRays];
  std::uint32_t instance[kPacketRays], primitive[kPacketRays];
};

// Children that wait to be visited; parallel arrays, `capacity` entries each.
struct PacketStack {
  std::uint32_t* children;
  float* nears;            // no ray enters earlier
  std::uint32_t* parents;  // row of the node that holds the child's box
  std::uint32_t* places;   // bits 0-2: where in that node; the rest: the first ray that may enter
};

// As ObjectRay, for the rays that need no shift or scale (see object_ray.h); `moved` names the others.
struct alignas(64) PacketRays {
  double origin[3][kPacketRays], direction[3][kPacketRays];
  float narrow_origin[3][kPacketRays], narrow_direction[3][kPacketRays];
  RaySet moved;
  TimeFrame moved_time[kPacketRays];
  double start[3][kPacketRays];  // of the moved ones: their origin before that
  // By direction: which run down each axis, and for which that axis is the longest.
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
  unsigned lanes;             // the same, rounded up to whole vectors
  std::uint32_t common_mask;  // the bits that all rays share
  unsigned alone;             // ways that one ray went by itself, or into an instance with few others
  PacketStack stack;
  Slot* slot;  // of a scene in which something moves: for a ray that goes by itself
  alignas(64) float t_min[kPacketRays], t_max[kPacketRays];  // of the rays themselves
  PacketRays world_rays, local_rays;
  PacketBoxes world, local;
  PacketTriangles triangles;
  PacketHits hits;
};

// A vector of rays against one box: which rays enter it. `box` points to its lower x among its node's planes.
PERFECT_BVH_INLINE unsigned test_box(const PacketBoxes& rays, const OctantRows& rows, const float* box,
                                     unsigned first) noexcept {
  RayFloat near = load_rays(rays.t_min + first), far = load_rays(rays.t_limit + first);
  for (int axis = 0; axis < 3; ++axis) {
    const RayFloat inverse = load_rays(rays.inverse[axis] + first);
    const float *near_plane = box + rows.near_row[axis] / 4, *far_plane = box + rows.far_row[axis] / 4;
    near = max(fmsub(every_ray(*near_plane), inverse, load_rays(rays.near_offset[axis] + first)), near);
    far = min(fmsub(every_ray(*far_plane), inverse, load_rays(rays.far_offset[axis] + first)), far);
  }
  return bits(less_equal(near, far));
}
