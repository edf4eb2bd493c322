// Tests the eight curve segments or points of a leaf against a ray. A filter in float finds those that the ray may hit,
// eight at a time. Then math/round_segment.h and math/curve_joint.h decide in double, one at a time. So float decides
// nothing: not whether there is a hit, not its t, and not which of two is nearer. Part of stream_kernel.inl: everything
// has internal linkage.
//
// The filter. A hull lies in the capsule about its axis with the larger of its radii. Leaves of curves store the
// capsule in whole steps from their corner, and rounding does not shrink it (wide/leaf_block.cpp). For other leaves the
// capsule is gathered: the first centre is the corner, and a step is 1. Let o be the point of the line nearest to the
// corner (found in double), d the ray's direction, w0 and w1 the ends of an axis from o, in steps. The distance between
// the line and a point of the axis, w = w0 + s (w1 - w0), is |d x w| / |d|. With k = d x w0 and e = d x (w1 - w0), it
// is least at s = -k.e / e.e, or at the end on that side. Both sides of the comparison stay multiplied by |d|.
//
// Rounding errors, divided by |d|. u = 2^-24; M = the sum of the largest component of o, that of w0 and w1, and the
// radius. Components of w are off by 2 u M each, their products with d by 6.7 u M in all, so k and k + e by 12 u M. The
// least distance between points moves no farther than the points do. s is off by less than 6 u |k| / |e|, its share of
// e by less than 10 u M. The rest (e as rounded, the point at s, its square, the radius and |d|) is off by less than 16
// u M. The depth d.w is off by less than 10 u M, t's limits are narrowed (u M; limits far away cannot err), and a hit's
// t is rounded: these errors are added to the limits. 64 u M bounds all of it. The line's slack covers the errors of
// double arithmetic on the ray (when it is mapped and when it is tested: 16 of its u times all distances) and underflow
// (2^-60).

constexpr float kRoundSlack = 0x1p-18f;

// Returns the line's slack, in units of the tree. The tree is within `reach` of its origin, and rays begin within
// kNearby times that.
PERFECT_BVH_INLINE float line_slack(float reach) noexcept { return 0x1p-43f * reach + 0x1p-60f; }

struct Vector8 {
  Float8 x, y, z;
};
PERFECT_BVH_INLINE Vector8 broadcast3(const float* v) noexcept {
  return {broadcast(v[0]), broadcast(v[1]), broadcast(v[2])};
}
PERFECT_BVH_INLINE Vector8 sub8(const Vector8& a, const Vector8& b) noexcept {
  return {sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z)};
}
PERFECT_BVH_INLINE Float8 dot8(const Vector8& a, const Vector8& b) noexcept {
  return fmadd(a.z, b.z, fmadd(a.y, b.y, mul(a.x, b.x)));
}
PERFECT_BVH_INLINE Vector8 cross8(const Vector8& a, const Vector8& b) noexcept {
  return {fmsub(a.y, b.z, mul(a.z, b.y)), fmsub(a.z, b.x, mul(a.x, b.z)), fmsub(a.x, b.y, mul(a.y, b.x))};
}
PERFECT_BVH_INLINE Float8 largest8(const Vector8& a) noexcept { return max(max(abs(a.x), abs(a.y)), abs(a.z)); }

// Tests whether the line comes within `reach` of points. `square` is their |d x w|^2; the depths are their least and
// greatest.
PERFECT_BVH_INLINE unsigned lanes_within(const LeafLine& line, Float8 reach, Float8 square, Float8 first_depth,
                                         Float8 last_depth) noexcept {
  const Float8 margin = mul(reach, broadcast(line.length));
  const Mask8 is_near = less_equal(square, mul(mul(reach, reach), broadcast(line.squared_length)));
  const Mask8 in_range = both(less_equal(sub(first_depth, margin), broadcast(line.most)),
                              less_equal(broadcast(line.least), add(last_depth, margin)));
  return bits(both(is_near, in_range));
}

// Tests capsules: `first` is w0, `axis` is w1 - w0.
PERFECT_BVH_INLINE unsigned lanes_near_capsules(const LeafLine& line, const Vector8& first, const Vector8& axis,
                                                Float8 reach) noexcept {
  const Vector8 direction = broadcast3(line.direction);
  const Vector8 k = cross8(direction, first), e = cross8(direction, axis);
  const float one = 1.0f, smallest = 0x1p-126f;  // no division by 0, whose NaN each processor treats differently
  const Float8 s = div(sub(zero(), dot8(k, e)), max(dot8(e, e), broadcast(smallest)));
  const Float8 share = min(max(s, zero()), broadcast(one));
  const Vector8 q{fmadd(share, e.x, k.x), fmadd(share, e.y, k.y), fmadd(share, e.z, k.z)};
  const Float8 depth = dot8(direction, first), depth1 = add(depth, dot8(direction, axis));
  return lanes_within(line, reach, dot8(q, q), min(depth, depth1), max(depth, depth1));
}

// Filters a leaf of curves. No component of an end exceeds 1023 steps, no radius 255.
PERFECT_BVH_INLINE unsigned round_candidates(const CurveLeaf& leaf, const LeafLine& line) noexcept {
  const Int8 firsts = load(leaf.first), lasts = load(leaf.last);
  const Vector8 first{ten_bits<0>(firsts), ten_bits<1>(firsts), ten_bits<2>(firsts)};
  const Vector8 last{ten_bits<0>(lasts), ten_bits<1>(lasts), ten_bits<2>(lasts)};
  const float slack = kRoundSlack * (2.0f * line.away + 1280.0f) + line.slack;
  const Float8 reach = add(load_small(leaf.radii), broadcast(slack));
  return lanes_near_capsules(line, sub8(first, broadcast3(line.nearest)), sub8(last, first), reach) & leaf.lanes;
}

// Returns spheres (rows of x, y, z and radii) relative to the corner.
PERFECT_BVH_INLINE Vector8 from_corner(const float (*rows)[8], const LeafCorner& corner) noexcept {
  return sub8({load(rows[0]), load(rows[1]), load(rows[2])}, broadcast3(corner.at));
}

// Filters gathered segments.
PERFECT_BVH_INLINE unsigned round_candidates(const GatheredBalls& leaf, const LeafCorner& corner,
                                             const LeafLine& line) noexcept {
  const Vector8 nearest = broadcast3(line.nearest);
  const Vector8 first = sub8(from_corner(leaf.first, corner), nearest);
  const Vector8 last = sub8(from_corner(leaf.last, corner), nearest);
  const Float8 radius = max(load(leaf.first[3]), load(leaf.last[3]));
  const Float8 size = add(max(largest8(first), largest8(last)), add(broadcast(line.away), radius));
  const Float8 reach = add(radius, fmadd(size, broadcast(kRoundSlack), broadcast(line.slack)));
  return lanes_near_capsules(line, first, sub8(last, first), reach);
}

// Filters gathered points.
PERFECT_BVH_INLINE unsigned round_candidates(const float (*rows)[8], const LeafCorner& corner,
                                             const LeafLine& line) noexcept {
  const Vector8 direction = broadcast3(line.direction);
  const Vector8 centre = sub8(from_corner(rows, corner), broadcast3(line.nearest));
  const Float8 radius = load(rows[3]), size = add(largest8(centre), add(broadcast(line.away), radius));
  const Float8 reach = add(radius, fmadd(size, broadcast(kRoundSlack), broadcast(line.slack)));
  const Vector8 k = cross8(direction, centre);
  const Float8 depth = dot8(direction, centre);
  return lanes_within(line, reach, dot8(k, k), depth, depth);
}

// Removes the repetitions of the last primitive in gathered leaves.
PERFECT_BVH_INLINE unsigned without_repeated(unsigned lanes, const std::uint32_t* primitives) noexcept {
  for (int lane = 1; lanes != 0 && lane < 8; ++lane) {
    if (primitives[lane] == primitives[lane - 1]) lanes &= ~(1u << lane);
  }
  return lanes;
}

// The primitives of a leaf that a ray may hit, once each.
struct RoundCandidates {
  const std::uint32_t* primitives;
  unsigned lanes;

  PERFECT_BVH_INLINE RoundCandidates(const RoundLeaves& leaves, std::uint32_t row, const ObjectRay& ray, float t_min,
                                     float t_limit, float reach) noexcept
      : primitives(leaves.primitives(row)) {
    const float slack = line_slack(reach);
    if (leaves.round.later != nullptr) {
      lanes = without_repeated(moving_candidates(leaves.round, ray, t_min, t_limit, slack), primitives);
    } else if (leaves.curves != nullptr) {
      const CurveLeaf& leaf = leaves.curves[row];
      lanes = round_candidates(leaf, leaf_line(leaf.corner, ray, t_min, t_limit, slack));
    } else {
      lanes = without_repeated(point_candidates(leaves.round, ray, t_min, t_limit, slack), primitives);
    }
  }

 private:
  // Filters spheres between two steps. Interpolation adds one more rounding, for which kRoundSlack has room.
  [[nodiscard]] __attribute__((noinline)) unsigned moving_candidates(const RoundList& list, const ObjectRay& ray,
                                                                     float t_min, float t_limit,
                                                                     float slack) const noexcept {
    const auto first_of = [&](int lane) {
      return list.segments == nullptr ? primitives[lane] : list.segments[primitives[lane]] & kSegmentBall;
    };
    const std::uint32_t to_last = list.segments == nullptr ? 0 : 1;
    GatheredBalls balls, later;
    gather_balls(balls.first, list.scale, [&](int lane) -> const Ball& { return list.balls[first_of(lane)]; });
    gather_balls(later.first, list.scale, [&](int lane) -> const Ball& { return list.later[first_of(lane)]; });
    gather_balls(balls.last, list.scale, [&](int lane) -> const Ball& { return list.balls[first_of(lane) + to_last]; });
    gather_balls(later.last, list.scale, [&](int lane) -> const Ball& { return list.later[first_of(lane) + to_last]; });
    const Shares shares(list.moment);
    for (int row = 0; row < 4; ++row) {
      store(balls.first[row], interpolate(shares, load(balls.first[row]), load(later.first[row])));
      store(balls.last[row], interpolate(shares, load(balls.last[row]), load(later.last[row])));
    }
    const LeafCorner corner = corner_of(balls);
    return round_candidates(balls, corner, leaf_line(corner, ray, t_min, t_limit, slack));
  }

  [[nodiscard]] __attribute__((noinline)) unsigned point_candidates(const RoundList& list, const ObjectRay& ray,
                                                                    float t_min, float t_limit,
                                                                    float slack) const noexcept {
    GatheredBalls balls;
    gather_balls(balls.first, list.scale, [&](int lane) -> const Ball& { return list.balls[primitives[lane]]; });
    const LeafCorner corner = corner_of(balls);
    return round_candidates(balls.first, corner, leaf_line(corner, ray, t_min, t_limit, slack));
  }

  static LeafCorner corner_of(const GatheredBalls& balls) noexcept {
    return {{balls.first[0][0], balls.first[1][0], balls.first[2][0]}, 1.0f};
  }
};

// Returns the number of different primitives, for the counts.
inline std::uint32_t count_round(const RoundLeaves& leaves, std::uint32_t row) noexcept {
  if (leaves.curves != nullptr) return count_bits(leaves.curves[row].lanes);
  return count_bits(without_repeated(0xFF, leaves.points[row].primitives));
}

// A primitive's chord, and its ends in the ray's own t.
struct RoundMeeting {
  Chord chord;
  double entry, exit;
};

// Converts the end of a chord to the ray's own t, rounded to float before that, as a triangle's t is. Out of line: GCC
// 12 (12.2, -O2) omits the rounding when it vectorizes both ends together.
__attribute__((noinline)) double end_in_ray(const TimeFrame& time, double local_t) noexcept {
  return to_ray_t(time, static_cast<float>(local_t));
}

// Returns false if the ray's line misses the primitive.
inline bool meet_round(RoundMeeting& meeting, const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                       const TimeFrame& time) noexcept {
  const Chord chord = chord_of(ray, list, primitive);
  if (!is_hit(chord)) return false;
  meeting.chord = chord;
  meeting.entry = end_in_ray(time, chord.entry);
  meeting.exit = end_in_ray(time, chord.exit);
  return true;
}

// A hit of a curve or point; u is along the segment.
struct RoundHit {
  double t;
  float u;
};

// Finds the first end of a primitive's chord that is visible and for which `counts(t)` is true. Visibility is tested
// last, because it needs the neighbours' chords. The front is always where rays enter, even in mirrored instances.
template <class Counts>
inline bool meet_end(RoundHit& hit, const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                     const TimeFrame& time, Cull cull, const Counts& counts) noexcept {
  RoundMeeting meeting;
  if (!meet_round(meeting, ray, list, primitive, time)) return false;
  const bool may_enter = counts(meeting.entry);
  const bool may_exit = cull != Cull::kBack && counts(meeting.exit);
  if (!may_enter && !may_exit) return false;
  const ShownEnds shows = shown_ends(ray, list, primitive, meeting.chord);
  const bool is_entry = may_enter && shows.entry;
  if (!is_entry && !(may_exit && shows.exit)) return false;
  hit.t = is_entry ? meeting.entry : meeting.exit;
  hit.u = static_cast<float>(share_of(ray, list, primitive, is_entry ? meeting.chord.entry : meeting.chord.exit));
  return true;
}

// Makes a candidate the slot's best hit, if it is the best.
inline bool take_round_hit(Slot& slot, const InstanceView* instances, const Ray& ray, Cull cull, const RoundRay& local,
                           const RoundList& list, std::uint32_t primitive) noexcept {
  const auto counts = [&](double t) {
    if (!(is_in_range(t, ray) && t <= slot.best_t)) return false;
    return !(t == slot.best_t && slot.hit_instance != kNoHit) ||
           wins_tie(instances, slot.instance, primitive, slot.hit_instance, slot.hit_primitive);
  };
  RoundHit hit;
  if (!meet_end(hit, local, list, primitive, slot.local.time, cull, counts)) return false;
  slot.best_t = hit.t;
  slot.u = hit.u, slot.v = 0.0f;
  slot.hit_instance = slot.instance;
  slot.hit_primitive = primitive;
  return true;
}

// Moving leaf ---------------------------------------------------------------------------------------------------------
// The nodes and leaves of a tree between two of its steps: boxes and vertices move in straight lines (math/turning.h).
// Part of stream_kernel.inl: everything has internal linkage.

// Like test_node(), for the boxes at a moment.
PERFECT_BVH_INLINE NodeTest test_moving_node(const WideNode& node, const WideNode& later, const BoxState& box,
                                             const Moment& moment) noexcept {
  const Shares shares(moment);
  const auto row = [&](std::size_t offset) __attribute__((always_inline)) {
    return interpolate(shares, load_row(&node, offset), load_row(&later, offset));
  };
  const float *const inverse = box.slab.inverse, *const near_offset = box.slab.near_offset;
  const float* const far_offset = box.slab.far_offset;
  const Float8 near_x = plane_depths<0>(row(box.rows.near_row[0]), inverse, near_offset);
  const Float8 near_y = plane_depths<1>(row(box.rows.near_row[1]), inverse, near_offset);
  const Float8 near_z = plane_depths<2>(row(box.rows.near_row[2]), inverse, near_offset);
  const Float8 far_x = plane_depths<0>(row(box.rows.far_row[0]), inverse, far_offset);
  const Float8 far_y = plane_depths<1>(row(box.rows.far_row[1]), inverse, far_offset);
  const Float8 far_z = plane_depths<2>(row(box.rows.far_row[2]), inverse, far_offset);
  const Float8 near = max(max(near_x, near_y), max(near_z, broadcast(box.t_min)));
  const Float8 far = min(min(far_x, far_y), min(far_z, broadcast(box.t_limit)));
  return {near, less_equal(near, far)};
}

PERFECT_BVH_INLINE NodeTest test_any_node(const Slot& slot, std::uint32_t row) noexcept {
  if (slot.later_nodes == nullptr) return test_node(slot.nodes[row], slot.box);
  return test_moving_node(slot.nodes[row], slot.later_nodes[row], slot.box, slot.moment);
}

// Returns the interpolated node at that moment.
inline WideNode node_between(const WideNode& from, const WideNode& to, const Moment& moment) noexcept {
  WideNode node = from;
  const Shares shares(moment);
  for (int i = 0; i < 6; ++i) {
    store(node.planes[i], interpolate(shares, load(from.planes[i]), load(to.planes[i])));
  }
  return node;
}

// The interpolated leaf at that moment, between those of two steps. Its vertices are interpolated when they are read.
// Its bound of the triangles' spans is larger, because interpolation rounds vertices by a fraction of their distance
// from the origin, which `reach` bounds.
struct MovingBlock {
  const LeafBlock &from, &to;
  const Moment& moment;
  const std::uint32_t* primitives;
  float span;

  PERFECT_BVH_INLINE MovingBlock(const TreeStep* step, const Moment& at, std::uint32_t row, float slack) noexcept
      : from(step[0].leaves.blocks[row]), to(step[1].leaves.blocks[row]), moment(at), primitives(from.primitives) {
    span = 0.0f;  // span_bound() of a leaf that is a point is NaN or -infinity
    if (span_bound(from) > span) span = span_bound(from);
    if (span_bound(to) > span) span = span_bound(to);
    span = span * (1.0f + 0x1p-10f) + slack;
  }
};

PERFECT_BVH_INLINE ShearedCorners shear(const MovingBlock& block, const TriangleState& triangle) noexcept {
  const Shares shares(block.moment);
  const auto row = [&](int i) __attribute__((always_inline)) {
    return interpolate(shares, load_row(block.from.vertices, triangle.row[i]),
                       load_row(block.to.vertices, triangle.row[i]));
  };
  return shear_vertices(row, block.from.corners, triangle);
}
PERFECT_BVH_INLINE float span_bound(const MovingBlock& block) noexcept { return block.span; }
inline float coordinate(const MovingBlock& block, int lane, int corner, int axis) noexcept {
  return interpolate(block.moment, coordinate(block.from, lane, corner, axis),
                     coordinate(block.to, lane, corner, axis));
}

// Returns the curves or points at a moment: those of a step, with the next step's spheres.
PERFECT_BVH_INLINE RoundLeaves moving_leaves(const TreeStep* step, const Moment& moment) noexcept {
  RoundLeaves leaves = *step[0].leaves.round_leaves;
  if (moment.is_between()) leaves.round.later = step[1].leaves.round_leaves->round.balls, leaves.round.moment = moment;
  return leaves;
}

// Calls body with the slot's leaf in its actual type: a LeafBlock or MovingBlock, or RoundLeaves with the row.
template <bool kMoves, class Body>
PERFECT_BVH_INLINE auto with_leaf(const Slot& slot, const InstanceView& instance, std::uint32_t row,
                                  const Body& body) noexcept {
  if (kMoves && slot.step != nullptr) {
    if (slot.blocks == nullptr) return body(moving_leaves(slot.step, slot.moment));
    if (slot.moment.is_between()) return body(MovingBlock(slot.step, slot.moment, row, slot.span_slack));
  }
  return slot.blocks == nullptr ? body(*instance.leaves.round_leaves) : body(slot.blocks[row]);
}
