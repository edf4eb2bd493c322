// The eight triangles of a leaf against a ray: math/triangle.h, eight at a time. Every kernel's leaf visit is made of
// these functions, so that each of them gives a triangle the same t. A `Leaf` is a LeafBlock, or the GatheredLeaf that
// was made of an IndexedLeaf. Part of stream_kernel.inl: everything has internal linkage.

// Of each lane; `lanes` has those that the ray's line passes through, and whose t may be in range.
struct LeafTest {
  Float8 weight_v0, weight_v1, weight_v2, sum;
  unsigned lanes;
};

template <class Float>
PERFECT_BVH_INLINE Float difference(Float a, Float b, Float c, Float d) noexcept {  // see product_difference
  const Float product = mul(c, d);
  return add(fmsub(a, b, product), fnmadd(c, d, product));
}

// From the ray's origin, along the sheared frame's axes.
struct ShearedCorners {
  Float8 x0, y0, z0, x1, y1, z1, x2, y2, z2;
};

PERFECT_BVH_INLINE ShearedCorners shear(const LeafBlock& block, const TriangleState& triangle) noexcept {
  const TriangleRay& ray = triangle.ray;
  const Float8 depth = sub(load_row(block.vertices, triangle.row[2]), broadcast(ray.origin[2]));
  const Float8 across =
      fnmadd(broadcast(ray.shear_x), depth, sub(load_row(block.vertices, triangle.row[0]), broadcast(ray.origin[0])));
  const Float8 upward =
      fnmadd(broadcast(ray.shear_y), depth, sub(load_row(block.vertices, triangle.row[1]), broadcast(ray.origin[1])));
  const Int8 corner0 = load(block.corners), corner1 = shift_right<4>(corner0), corner2 = shift_right<8>(corner0);
  return {permute(across, corner0), permute(upward, corner0), permute(depth, corner0),
          permute(across, corner1), permute(upward, corner1), permute(depth, corner1),
          permute(across, corner2), permute(upward, corner2), permute(depth, corner2)};
}

PERFECT_BVH_INLINE void shear_corner(const float (*rows)[8], const TriangleState& triangle, Float8& x, Float8& y,
                                     Float8& z) noexcept {
  const TriangleRay& ray = triangle.ray;
  z = sub(load_row(rows, triangle.row[2]), broadcast(ray.origin[2]));
  x = fnmadd(broadcast(ray.shear_x), z, sub(load_row(rows, triangle.row[0]), broadcast(ray.origin[0])));
  y = fnmadd(broadcast(ray.shear_y), z, sub(load_row(rows, triangle.row[1]), broadcast(ray.origin[1])));
}

PERFECT_BVH_INLINE ShearedCorners shear(const GatheredLeaf& leaf, const TriangleState& triangle) noexcept {
  ShearedCorners at;
  shear_corner(leaf.corners[0], triangle, at.x0, at.y0, at.z0);
  shear_corner(leaf.corners[1], triangle, at.x1, at.y1, at.z1);
  shear_corner(leaf.corners[2], triangle, at.x2, at.y2, at.z2);
  return at;
}

template <class Leaf>
PERFECT_BVH_INLINE LeafTest test_leaf(const Leaf& leaf, const TriangleState& triangle) noexcept {
  const auto [x0, y0, z0, x1, y1, z1, x2, y2, z2] = shear(leaf, triangle);
  const Float8 weight0 = difference(x2, y1, y2, x1);
  const Float8 weight1 = difference(x0, y2, y0, x2);
  const Float8 weight2 = difference(x1, y0, y1, x0);
  const Float8 least = min(min(weight0, weight1), weight2), most = max(max(weight0, weight1), weight2);
  const Float8 sum = add(add(weight0, weight1), weight2);
  const Mask8 inside = both(either(less_equal(zero(), least), less_equal(most, zero())), not_equal(sum, zero()));
  const Float8 nearest = min(min(z0, z1), z2), farthest = max(max(z0, z1), z2);
  const Mask8 in_range = both(less_equal(broadcast(triangle.least_depth), farthest),
                              less_equal(nearest, broadcast(triangle.largest_depth)));
  return {weight0, weight1, weight2, sum, bits(both(inside, in_range))};
}

// The lanes of a LeafTest in memory, to be looked at one by one.
struct LeafCandidates {
  explicit LeafCandidates(const LeafTest& test) noexcept {
    store(weights_v0, test.weight_v0), store(weights_v1, test.weight_v1), store(weights_v2, test.weight_v2);
    store(sums, test.sum);
  }
  alignas(32) float weights_v0[8], weights_v1[8], weights_v2[8], sums[8];
};

inline float coordinate(const LeafBlock& block, int lane, int corner, int axis) noexcept {
  return block.vertices[axis][(block.corners[lane] >> (4 * corner)) & 7];
}
inline float coordinate(const GatheredLeaf& leaf, int lane, int corner, int axis) noexcept {
  return leaf.corners[corner][axis][lane];
}

// The plane of one of its triangles.
template <class Leaf>
PERFECT_BVH_INLINE TrianglePlane lone_plane(const Leaf& leaf, int lane, float (&corners)[3][3]) noexcept {
  for (int corner = 0; corner < 3; ++corner) {
    for (int axis = 0; axis < 3; ++axis) corners[corner][axis] = coordinate(leaf, lane, corner, axis);
  }
  return plane_of(corners[0], corners[1], corners[2]);
}

// Where its corners are along the sheared z.
struct CornerDepths {
  template <class Leaf>
  CornerDepths(const Leaf& leaf, int lane, const TriangleRay& ray) noexcept {
    for (int i = 0; i < 3; ++i) z[i] = coordinate(leaf, lane, i, ray.axes[2]) - ray.origin[2];
  }
  float z[3];
};

// Whether t of a triangle that the ray's line passes through is in range, wherever between its corners' depths it is
// met. The range is that of the TriangleState, which is too wide by depth_slack.
PERFECT_BVH_INLINE bool is_surely_in_range(const TriangleState& triangle, const CornerDepths& depths) noexcept {
  const float *const z = depths.z, margin = 2.0f * triangle.ray.depth_slack * magnitude(triangle.ray.direction_z);
  return smaller(smaller(z[0], z[1]), z[2]) - margin >= triangle.least_depth &&
         larger(larger(z[0], z[1]), z[2]) + margin <= triangle.largest_depth;
}

PERFECT_BVH_INLINE bool is_in_range(double t, const Ray& ray) noexcept {
  const float narrowed = static_cast<float>(t);
  return narrowed >= ray.t_min && narrowed <= ray.t_max && narrowed < kInfiniteDistance;
}

// Beside an edge it takes a closer look.
template <class Leaf>
__attribute__((noinline)) float settle_beside_edge(const LeafCandidates& candidates, int lane, const Leaf& leaf,
                                                   const TriangleRay& ray, const ObjectRay& local) noexcept {
  const float weights[3] = {candidates.weights_v0[lane], candidates.weights_v1[lane], candidates.weights_v2[lane]};
  float at[3][3];
  const TrianglePlane plane = lone_plane(leaf, lane, at);
  const float* const corners[3] = {at[0], at[1], at[2]};
  return settle_t(ray, plane, corners, local.origin, local.direction, weights, candidates.sums[lane],
                  CornerDepths(leaf, lane, ray).z);
}

// In the ray's own terms: settle_t(). `local`: what the tree's TriangleRay was made of.
template <class Leaf>
PERFECT_BVH_INLINE double candidate_t(const LeafCandidates& candidates, int lane, const Leaf& leaf,
                                      const TriangleRay& ray, const ObjectRay& local) noexcept {
  const auto at = [&](int corner, int axis)
                      __attribute__((always_inline)) { return coordinate(leaf, lane, corner, axis); };
  const float weight0 = magnitude(candidates.weights_v0[lane]), weight1 = magnitude(candidates.weights_v1[lane]);
  const float least = smaller(smaller(weight0, weight1), magnitude(candidates.weights_v2[lane]));
  const PlaneMeeting plane = meet_plane(at, local.origin, local.direction);
  float t = static_cast<float>(plane.t);
  if (!(least >= ray.edge_slack * static_cast<float>(plane.span))) [[unlikely]] {
    t = settle_beside_edge(candidates, lane, leaf, ray, local);
  }
  return to_ray_t(local.time, t);
}

PERFECT_BVH_INLINE bool is_culled(Cull cull, float sum, const TriangleRay& ray, const InstanceView& instance) noexcept {
  if (cull == Cull::kNone) return false;
  const bool is_front = ((sum > 0.0f) != ray.runs_down) != (instance.mirrored != 0);
  return is_front == (cull == Cull::kFront);
}

// Of two hits at the same t, the one of the smaller (order, id, primitive) counts.
inline bool wins_tie(const InstanceView* instances, std::uint32_t instance, std::uint32_t primitive,
                     std::uint32_t held_instance, std::uint32_t held_primitive) noexcept {
  if (instance == held_instance) return primitive < held_primitive;
  const InstanceView &mine = instances[instance], &holder = instances[held_instance];
  return mine.order != holder.order ? mine.order < holder.order : mine.id < holder.id;
}

// A candidate becomes the slot's best hit, if it is one.
template <class Leaf>
PERFECT_BVH_INLINE bool take_hit(Slot& slot, const InstanceView* instances, const Ray& ray, Cull cull, const Leaf& leaf,
                                 int lane, const LeafCandidates& candidates) noexcept {
  const double t = candidate_t(candidates, lane, leaf, slot.triangle.ray, slot.local);
  if (!(is_in_range(t, ray) && t <= slot.best_t)) return false;
  if (is_culled(cull, candidates.sums[lane], slot.triangle.ray, instances[slot.instance])) return false;
  const std::uint32_t primitive = leaf.primitives[lane];
  if (t == slot.best_t && slot.hit_instance != kNoHit &&
      !wins_tie(instances, slot.instance, primitive, slot.hit_instance, slot.hit_primitive)) {
    return false;
  }
  slot.best_t = t;
  slot.u = candidates.weights_v1[lane] / candidates.sums[lane];
  slot.v = candidates.weights_v2[lane] / candidates.sums[lane];
  slot.hit_instance = slot.instance;
  slot.hit_primitive = primitive;
  return true;
}

// Where any hit will do, whether a candidate is one for which t need not be known; the slot has it then.
template <class Leaf>
PERFECT_BVH_INLINE bool is_surely_hit(Slot& slot, const InstanceView* instances, Cull cull, const Leaf& leaf, int lane,
                                      const LeafCandidates& candidates) noexcept {
  if (!slot.time.is_direct || !is_surely_in_range(slot.triangle, CornerDepths(leaf, lane, slot.triangle.ray))) {
    return false;
  }
  if (is_culled(cull, candidates.sums[lane], slot.triangle.ray, instances[slot.instance])) return false;
  slot.hit_instance = slot.instance;
  return true;
}

// Without the last one's repetitions.
template <class Leaf>
inline std::uint32_t count_triangles(const Leaf& leaf) noexcept {
  std::uint32_t count = 1;
  for (int lane = 1; lane < 8; ++lane) count += leaf.primitives[lane] != leaf.primitives[lane - 1] ? 1u : 0u;
  return count;
}
