// Tests the eight triangles of a leaf against a ray: math/triangle.h, eight at a time. All kernels' leaf visits use
// these functions, so that each kernel computes the same t for a triangle. A `Leaf` is a LeafBlock, or the MovingBlock
// between two of them. Part of stream_kernel.inl: everything has internal linkage.

// The results of each lane. `lanes` has the triangles whose t may be in range and that the ray's line passes through,
// or may pass through near an edge. Of a repeated triangle it has only the first.
struct LeafTest {
  Float8 weight_v1, weight_v2, sum;
  Float8 least_weight;  // the least of the three, by magnitude; negative outside
  unsigned lanes;
};

template <class Float>
PERFECT_BVH_INLINE Float difference(Float a, Float b, Float c, Float d) noexcept {  // see product_difference
  const Float product = mul(c, d);
  return add(fmsub(a, b, product), fnmadd(c, d, product));
}

// Relative to the ray's origin, along the sheared frame's axes.
struct ShearedCorners {
  Float8 x0, y0, z0, x1, y1, z1, x2, y2, z2;
};

// `row(i)` returns a block's vertices along the sheared frame's axis i.
template <class Row>
PERFECT_BVH_INLINE ShearedCorners shear_vertices(const Row& row, const std::uint32_t* corners,
                                                 const TriangleState& triangle) noexcept {
  const TriangleRay& ray = triangle.ray;
  const Float8 depth = sub(row(2), broadcast(ray.origin[2]));
  const Float8 across = fnmadd(broadcast(ray.shear_x), depth, sub(row(0), broadcast(ray.origin[0])));
  const Float8 upward = fnmadd(broadcast(ray.shear_y), depth, sub(row(1), broadcast(ray.origin[1])));
  const Int8 corner0 = load(corners), corner1 = shift_right<4>(corner0), corner2 = shift_right<8>(corner0);
  return {permute(across, corner0), permute(upward, corner0), permute(depth, corner0),
          permute(across, corner1), permute(upward, corner1), permute(depth, corner1),
          permute(across, corner2), permute(upward, corner2), permute(depth, corner2)};
}

PERFECT_BVH_INLINE ShearedCorners shear(const LeafBlock& block, const TriangleState& triangle) noexcept {
  const auto row = [&](int i) __attribute__((always_inline)) { return load_row(block.vertices, triangle.row[i]); };
  return shear_vertices(row, block.corners, triangle);
}

// Returns an upper bound of the spans (math/triangle.h) of a block's triangles.
PERFECT_BVH_INLINE float span_bound(const LeafBlock& block) noexcept {
  return __builtin_bit_cast(float, block.corners[0]);
}

template <class Leaf>
PERFECT_BVH_INLINE LeafTest test_leaf(const Leaf& leaf, const TriangleState& triangle) noexcept {
  const auto [x0, y0, z0, x1, y1, z1, x2, y2, z2] = shear(leaf, triangle);
  const Float8 weight0 = difference(x2, y1, y2, x1);
  const Float8 weight1 = difference(x0, y2, y0, x2);
  const Float8 weight2 = difference(x1, y0, y1, x0);
  const Float8 least = min(min(weight0, weight1), weight2), most = max(max(weight0, weight1), weight2);
  const Float8 sum = add(add(weight0, weight1), weight2);
  const Float8 least_weight = max(least, sub(zero(), most));
  const float span = span_bound(leaf);
  const Float8 edge_slack = broadcast(triangle.ray.edge_slack);
  const Mask8 inside = less_equal(zero(), fmadd(add(broadcast(span), edge_slack), edge_slack, least_weight));
  const Float8 nearest = min(min(z0, z1), z2), farthest = max(max(z0, z1), z2);
  const Mask8 in_range = both(less_equal(broadcast(triangle.depths.least), farthest),
                              less_equal(nearest, broadcast(triangle.depths.most)));
  unsigned lanes = bits(both(inside, in_range));
  if (lanes != 0) lanes &= ~repeated_lanes(leaf.primitives);
  return {weight1, weight2, sum, least_weight, lanes};
}

// The lanes of a LeafTest in memory, to be read one by one.
struct LeafCandidates {
  explicit LeafCandidates(const LeafTest& test) noexcept {
    store(weights_v1, test.weight_v1), store(weights_v2, test.weight_v2), store(sums, test.sum);
    store(least_weights, test.least_weight);
  }
  alignas(32) float weights_v1[8], weights_v2[8], sums[8], least_weights[8];
};

inline float coordinate(const LeafBlock& block, int lane, int corner, int axis) noexcept {
  return block.vertices[axis][(block.corners[lane] >> (4 * corner)) & 7];
}

// The corners of one triangle.
struct LoneCorners {
  template <class Leaf>
  LoneCorners(const Leaf& leaf, int lane) noexcept {
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) at[corner][axis] = coordinate(leaf, lane, corner, axis);
    }
  }
  float at[3][3];
};

// The corners' depths along the sheared z.
struct CornerDepths {
  template <class Leaf>
  CornerDepths(const Leaf& leaf, int lane, const TriangleRay& ray) noexcept {
    for (int i = 0; i < 3; ++i) z[i] = coordinate(leaf, lane, i, ray.axes[2]) - ray.origin[2];
  }
  float z[3];
};

// Returns whether t is in range for any point between the depths of the corners. The ray's line passes through the
// triangle. The range is that of the TriangleState, which is too wide by depth_slack.
PERFECT_BVH_INLINE bool is_surely_in_range(const TriangleState& triangle, const CornerDepths& depths) noexcept {
  const float *const z = depths.z, margin = 2.0f * triangle.ray.depth_slack * magnitude(triangle.ray.direction_z);
  return smaller(smaller(z[0], z[1]), z[2]) - margin >= triangle.depths.least &&
         larger(larger(z[0], z[1]), z[2]) + margin <= triangle.depths.most;
}

PERFECT_BVH_INLINE bool is_in_range(double t, const Ray& ray) noexcept {
  const float narrowed = static_cast<float>(t);
  return narrowed >= ray.t_min && narrowed <= ray.t_max && magnitude(narrowed) < kInfiniteDistance;
}

// The intersection of a ray with one triangle: t in the ray's own terms; u is weight_v1 / sum, v is weight_v2 / sum.
struct Meeting {
  double t;
  float weight_v1, weight_v2, sum;
};

// Returns whether float may be wrong about a triangle that it takes for hit. `span`: the triangle's span, or a bound of
// it, which makes this true more often.
PERFECT_BVH_INLINE bool is_beside_edge(float least_weight, const TriangleRay& ray, float span) noexcept {
  return !(least_weight > weight_slack(ray.edge_slack, span));
}

// Decides a triangle that is not surely hit inside its edges, or is seen edge-on from afar: intersect_triangle(), from
// after its float test.
template <class Leaf>
__attribute__((noinline)) bool meet_closely(Meeting& meeting, const LeafCandidates& candidates, int lane,
                                            const Leaf& leaf, const TriangleState& triangle,
                                            const ObjectRay& local) noexcept {
  const TriangleRay& ray = triangle.ray;
  const LoneCorners lone(leaf, lane);
  const auto& at = lone.at;
  const auto span = static_cast<float>(span_of(at[0], at[1], at[2]));
  const float least_weight = candidates.least_weights[lane];
  if (least_weight < -weight_slack(ray.edge_slack, span)) return false;
  const bool is_beside = is_beside_edge(least_weight, ray, span);
  if (!is_beside && (local.time.is_direct || !is_grazed(candidates.sums[lane], span))) {
    const auto t = static_cast<float>(plane_t(plane_of(at[0], at[1], at[2]), local.origin, local.direction));
    meeting = {to_ray_t(local.time, t), candidates.weights_v1[lane], candidates.weights_v2[lane],
               candidates.sums[lane]};
    return true;
  }
  const float* const corners[3] = {at[0], at[1], at[2]};
  TriangleHit hit;
  const ExactRay exact = exact_ray(local);
  if (!(is_beside ? intersect_beside_edge(ray, exact, corners, triangle.depths, hit)
                  : intersect_exactly(ray, exact, corners, hit))) {
    return false;
  }
  const float turn = hit.is_front != ray.runs_down ? 1.0f : -1.0f;
  meeting = {to_ray_t(local.time, hit.t), hit.u * turn, hit.v * turn, turn};
  return true;
}

// Returns whether the ray's line hits a candidate within the limits of t, and where. May also return true beyond the
// limits. `local`: the ray from which the tree's TriangleRay was made.
template <class Leaf>
PERFECT_BVH_INLINE bool meet_candidate(Meeting& meeting, const LeafCandidates& candidates, int lane, const Leaf& leaf,
                                       const TriangleState& triangle, const ObjectRay& local) noexcept {
  const float span = span_bound(leaf);
  if (is_beside_edge(candidates.least_weights[lane], triangle.ray, span) ||
      (!local.time.is_direct && is_grazed(candidates.sums[lane], span))) [[unlikely]] {
    return meet_closely(meeting, candidates, lane, leaf, triangle, local);
  }
  const auto at = [&](int corner, int axis)
                      __attribute__((always_inline)) { return coordinate(leaf, lane, corner, axis); };
  const auto t = static_cast<float>(meet_plane(at, local.origin, local.direction));
  meeting = {to_ray_t(local.time, t), candidates.weights_v1[lane], candidates.weights_v2[lane], candidates.sums[lane]};
  return true;
}

PERFECT_BVH_INLINE bool is_culled(Cull cull, float sum, const TriangleRay& ray, bool is_mirrored) noexcept {
  if (cull == Cull::kNone) return false;
  const bool is_front = ((sum > 0.0f) != ray.runs_down) != is_mirrored;
  return !is_front;
}

// Breaks a tie: of two hits at the same t, the smaller (order, id, primitive) wins.
inline bool wins_tie(const InstanceView* instances, std::uint32_t instance, std::uint32_t primitive,
                     std::uint32_t held_instance, std::uint32_t held_primitive) noexcept {
  if (instance == held_instance) return primitive < held_primitive;
  const InstanceView &mine = instances[instance], &holder = instances[held_instance];
  return mine.order != holder.order ? mine.order < holder.order : mine.id < holder.id;
}

// Makes a candidate the slot's best hit, if it is the best.
template <class Leaf>
PERFECT_BVH_INLINE bool take_hit(Slot& slot, const InstanceView* instances, const Ray& ray, Cull cull, const Leaf& leaf,
                                 int lane, const LeafCandidates& candidates) noexcept {
  Meeting meeting;
  if (!meet_candidate(meeting, candidates, lane, leaf, slot.triangle, slot.local)) return false;
  const double t = meeting.t;
  if (!(is_in_range(t, ray) && t <= slot.best_t)) return false;
  if (is_culled(cull, meeting.sum, slot.triangle.ray, slot.is_mirrored)) return false;
  const std::uint32_t primitive = leaf.primitives[lane];
  if (t == slot.best_t && slot.hit_instance != kNoHit &&
      !wins_tie(instances, slot.instance, primitive, slot.hit_instance, slot.hit_primitive)) {
    return false;
  }
  slot.best_t = t;
  slot.u = meeting.weight_v1 / meeting.sum;
  slot.v = meeting.weight_v2 / meeting.sum;
  slot.hit_instance = slot.instance;
  slot.hit_primitive = primitive;
  return true;
}

// For any-hit rays: returns whether a candidate is surely a hit, without knowing its t, and stores it in the slot.
template <class Leaf>
PERFECT_BVH_INLINE bool is_surely_hit(Slot& slot, Cull cull, const Leaf& leaf, int lane,
                                      const LeafCandidates& candidates) noexcept {
  const TriangleRay& ray = slot.triangle.ray;
  if (!slot.time.is_direct || is_beside_edge(candidates.least_weights[lane], ray, span_bound(leaf))) return false;
  if (!is_surely_in_range(slot.triangle, CornerDepths(leaf, lane, ray))) return false;
  if (is_culled(cull, candidates.sums[lane], ray, slot.is_mirrored)) return false;
  slot.hit_instance = slot.instance;
  return true;
}

// Counts the triangles without repetitions of the last.
PERFECT_BVH_INLINE unsigned count_triangles(const std::uint32_t* primitives) noexcept {
  return 8 - count_bits(repeated_lanes(primitives));
}

// Node test -----------------------------------------------------------------------------------------------------------
// Tests the eight boxes of a node against a ray: math/slab.h, eight at a time.
// Part of stream_kernel.inl: everything has internal linkage.

// `near`: the entry distance of each box.
struct NodeTest {
  Float8 near;
  Mask8 hit;
};

PERFECT_BVH_INLINE NodeTest test_node(const WideNode& node, const BoxState& box) noexcept {
  const float *const inverse = box.slab.inverse, *const near_offset = box.slab.near_offset;
  const float* const far_offset = box.slab.far_offset;
  const Float8 near_x = plane_depths<0>(load_row(&node, box.rows.near_row[0]), inverse, near_offset);
  const Float8 near_y = plane_depths<1>(load_row(&node, box.rows.near_row[1]), inverse, near_offset);
  const Float8 near_z = plane_depths<2>(load_row(&node, box.rows.near_row[2]), inverse, near_offset);
  const Float8 far_x = plane_depths<0>(load_row(&node, box.rows.far_row[0]), inverse, far_offset);
  const Float8 far_y = plane_depths<1>(load_row(&node, box.rows.far_row[1]), inverse, far_offset);
  const Float8 far_z = plane_depths<2>(load_row(&node, box.rows.far_row[2]), inverse, far_offset);
  const Float8 near = max(max(near_x, near_y), max(near_z, broadcast(box.t_min)));
  const Float8 far = min(min(far_x, far_y), min(far_z, broadcast(box.t_limit)));
  return {near, less_equal(near, far)};
}

// Shares --------------------------------------------------------------------------------------------------------------
// Interpolates eight lanes between two steps (math/turning.h).
// Part of stream_kernel.inl: everything has internal linkage.

struct Shares {
  Float8 earlier, later;
  explicit Shares(const Moment& moment) noexcept : earlier(broadcast(moment.earlier)), later(broadcast(moment.later)) {}
};

PERFECT_BVH_INLINE Float8 interpolate(const Shares& shares, const Float8& a, const Float8& b) noexcept {
  return fmadd(shares.later, b, mul(shares.earlier, a));
}
