// The eight curve segments, or points, of a leaf against a ray. Float finds out which of them the ray may meet, eight
// at a time; math/round_segment.h and math/curve_joint.h decide, one at a time, in double. So float decides nothing: no
// hit, no t, and not which of two is nearer. Part of stream_kernel.inl: everything has internal linkage.
//
// The filter. A hull lies in the capsule about its axis whose radius is the larger one's. Leaves of curves hold it in
// whole steps from their corner, which rounding makes no smaller (wide/leaf_block.cpp); of others it is gathered, the
// first centre is the corner, and a step is 1. Let o be the point of the line nearest to the corner (found in double),
// d the ray's direction, w0 and w1 the ends of an axis from o, in steps. The line is |d x w| / |d| away from a point of
// the axis, w = w0 + s (w1 - w0), and the least of this is where s is, with k = d x w0 and e = d x (w1 - w0),
// -k.e / e.e, or at the end on that side. Both sides of the comparison are left as |d| times what they are.
//
// What rounding does, over |d|. u = 2^-24; M = the largest component of o, w0 and w1, and the radius, added. Components
// of w are off by 2 u M each, their products with d by 6.7 u M in all, so k and k + e by 12 u M; the least distance
// between points that are moved so far is moved no farther. s is off by less than 6 u |k| / |e|, its share of e by less
// than 10 u M; what is left, e as rounded, the point at s, its square, the radius and |d|, by less than 16 u M. The
// depth d.w is off by less than 10 u M, t's limits are narrowed (u M; far away ones cannot err), and a hit's t is
// rounded: that is added to the limits. 64 u M holds all of it. What double does to the ray (as it was mapped, and is
// judged: 16 of its u times all distances) and underflow (2^-60) are in the line's slack.

constexpr float kRoundSlack = 0x1p-18f;

// In units of the tree, within `reach` of whose origin all that it holds is, and rays begin within kNearby of it.
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

// Whether the line comes as near as `reach`: of points, whose squares `square` are |d x w|^2, and least and greatest
// depths.
PERFECT_BVH_INLINE unsigned lanes_within(const LeafLine& line, Float8 reach, Float8 square, Float8 first_depth,
                                         Float8 last_depth) noexcept {
  const Float8 margin = mul(reach, broadcast(line.length));
  const Mask8 is_near = less_equal(square, mul(mul(reach, reach), broadcast(line.squared_length)));
  const Mask8 in_range = both(less_equal(sub(first_depth, margin), broadcast(line.most)),
                              less_equal(broadcast(line.least), add(last_depth, margin)));
  return bits(both(is_near, in_range));
}

// Capsules: `first` is w0, `axis` w1 - w0.
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

// Of a leaf of curves. No component of an end exceeds 1023 steps, no radius 255.
PERFECT_BVH_INLINE unsigned round_candidates(const CurveLeaf& leaf, const LeafLine& line) noexcept {
  const Int8 firsts = load(leaf.first), lasts = load(leaf.last);
  const Vector8 first{ten_bits<0>(firsts), ten_bits<1>(firsts), ten_bits<2>(firsts)};
  const Vector8 last{ten_bits<0>(lasts), ten_bits<1>(lasts), ten_bits<2>(lasts)};
  const float slack = kRoundSlack * (2.0f * line.away + 1280.0f) + line.slack;
  const Float8 reach = add(load_small(leaf.radii), broadcast(slack));
  return lanes_near_capsules(line, sub8(first, broadcast3(line.nearest)), sub8(last, first), reach) & leaf.lanes;
}

// Of balls, as rows of x, y, z and radii: from the corner.
PERFECT_BVH_INLINE Vector8 from_corner(const float (*rows)[8], const LeafCorner& corner) noexcept {
  return sub8({load(rows[0]), load(rows[1]), load(rows[2])}, broadcast3(corner.at));
}

// Of gathered segments.
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

// Of gathered points.
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

// Of gathered leaves, whose last primitive is repeated: each once.
PERFECT_BVH_INLINE unsigned without_repeated(unsigned lanes, const std::uint32_t* primitives) noexcept {
  for (int lane = 1; lanes != 0 && lane < 8; ++lane) {
    if (primitives[lane] == primitives[lane - 1]) lanes &= ~(1u << lane);
  }
  return lanes;
}

// A leaf's primitives: those that a ray may meet, once each.
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
  // Between two steps: rounded once more where balls are interpolated, for which kRoundSlack has room.
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

// For counts: how many different ones there are.
inline std::uint32_t count_round(const RoundLeaves& leaves, std::uint32_t row) noexcept {
  if (leaves.curves != nullptr) return count_bits(leaves.curves[row].lanes);
  return count_bits(without_repeated(0xFF, leaves.points[row].primitives));
}

// A primitive's chord, its ends in the ray's own terms too.
struct RoundMeeting {
  Chord chord;
  double entry, exit;
};

// The end of a chord in the ray's own terms, rounded to float before as a triangle's t is. Out of line: GCC 12
// (12.2, -O2) leaves the rounding out where it vectorizes the ways of both ends together.
__attribute__((noinline)) double end_in_ray(const TimeFrame& time, double local_t) noexcept {
  return to_ray_t(time, static_cast<float>(local_t));
}

// False if the ray's line passes it by.
inline bool meet_round(RoundMeeting& meeting, const RoundRay& ray, const RoundList& list, std::uint32_t primitive,
                       const TimeFrame& time) noexcept {
  const Chord chord = chord_of(ray, list, primitive);
  if (!is_hit(chord)) return false;
  meeting.chord = chord;
  meeting.entry = end_in_ray(time, chord.entry);
  meeting.exit = end_in_ray(time, chord.exit);
  return true;
}

// Where a ray meets a curve or point; u along the segment.
struct RoundHit {
  double t;
  float u;
};

// The first end of a primitive's chord that is shown and `counts(t)`. Whether it is shown is asked last: it takes the
// neighbours' chords. Its front is what rays enter by, however the instance is placed.
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

// A candidate becomes the slot's best hit, if it is one.
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
// The nodes and leaves of a tree between two of its steps: boxes and vertices in straight lines (math/turning.h).
// Part of stream_kernel.inl: everything has internal linkage.

// test_node() of the boxes at a moment.
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

// The node that a tree of that moment would have.
inline WideNode node_between(const WideNode& from, const WideNode& to, const Moment& moment) noexcept {
  WideNode node = from;
  const Shares shares(moment);
  for (int i = 0; i < 6; ++i) {
    store(node.planes[i], interpolate(shares, load(from.planes[i]), load(to.planes[i])));
  }
  return node;
}

// The leaf that a tree of that moment would have, between those of two steps: its vertices are interpolated when they
// are read. Its bound of the triangles' spans is larger: vertices are rounded where they are interpolated, by a part of
// how far away from the origin they are, which `reach` bounds.
struct MovingBlock {
  const LeafBlock &from, &to;
  const Moment& moment;
  const std::uint32_t* primitives;
  float span;

  PERFECT_BVH_INLINE MovingBlock(const TreeStep* step, const Moment& at, std::uint32_t row, float slack) noexcept
      : from(step[0].leaves.blocks[row]), to(step[1].leaves.blocks[row]), moment(at), primitives(from.primitives) {
    span = 0.0f;  // of a leaf that is a point it is no number
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

// Curves or points at a moment: those of a step, with the next step's balls.
PERFECT_BVH_INLINE RoundLeaves moving_leaves(const TreeStep* step, const Moment& moment) noexcept {
  RoundLeaves leaves = *step[0].leaves.round_leaves;
  if (moment.is_between()) leaves.round.later = step[1].leaves.round_leaves->round.balls, leaves.round.moment = moment;
  return leaves;
}

// The slot's leaf, as what it is: body(a LeafBlock or MovingBlock), or body(RoundLeaves) of what is in its row.
template <bool kMoves, class Body>
PERFECT_BVH_INLINE auto with_leaf(const Slot& slot, const InstanceView& instance, std::uint32_t row,
                                  const Body& body) noexcept {
  if (kMoves && slot.step != nullptr) {
    if (slot.blocks == nullptr) return body(moving_leaves(slot.step, slot.moment));
    if (slot.moment.is_between()) return body(MovingBlock(slot.step, slot.moment, row, slot.span_slack));
  }
  return slot.blocks == nullptr ? body(*instance.leaves.round_leaves) : body(slot.blocks[row]);
}
