// The eight curve segments, or points, of a leaf against a ray. Float finds out which of them the ray may meet, eight
// at a time; math/round_segment.h and math/curve_joint.h decide, one at a time, in double. So float decides nothing: no
// hit, no t, and not which of two is nearer. Part of stream_kernel.inl: everything has internal linkage.
//
// The filter. A hull lies in the capsule about its axis whose radius is the larger one's. Let o be the point of the
// line nearest to the leaf's first centre (found in double), d the direction of length 1, w0 and w1 the ends of an axis
// from o. The line is |d x w| away from a point of the axis, w = w0 + s (w1 - w0), and the least of this is where s is,
// with k = d x w0 and e = d x w1 - k, -k.e / e.e, or at the end on that side.
//
// What rounding does. u = 2^-24; M = the largest component of o (from the first centre), w0 and w1, and the radius,
// added. Components of w are off by 2 u M each, their products with d by 6.7 u M in all, so k and k + e by 12 u M; the
// least distance between points that are moved so far is moved no farther. s is off by less than 6 u |k| / |e|, its
// share of e by less than 10 u M; what is left, e as rounded, the point at s, its square and the radius, by less than
// 12 u M. The depth d.w is off by less than 10 u M, t's limits are narrowed (u M; far away ones cannot err), and a
// hit's t is rounded: that is added to the limits. 64 u M holds all of it. What double does to the ray (as it was
// mapped, and is judged: 16 of its u times all distances) and underflow (2^-62) are in `slack`.
constexpr float kRoundSlack = 0x1p-18f;

// A ray as the filter has it.
struct RoundFilter {
  float centre[3];     // the leaf's first
  float nearest[3];    // the line's point nearest to it, from there
  float direction[3];  // of length 1
  float least, most;   // hits are between these depths, from that point along the direction
  float away;          // largest component of `nearest`
  float slack;

  RoundFilter(const GatheredBalls& leaf, const RoundRay& ray, float t_min, float t_limit, float reach) noexcept {
    RoundBall ball;
    ball.radius = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      centre[axis] = leaf.first[axis][0];
      ball.centre[axis] = static_cast<double>(centre[axis]);
    }
    const NearestToCentre at = nearest_to_centre(ray, ball);
    const double length = __builtin_sqrt(ray.squared_length), inverse = 1.0 / length;
    for (int axis = 0; axis < 3; ++axis) {
      nearest[axis] = static_cast<float>(at.point[axis]);
      direction[axis] = static_cast<float>(ray.direction[axis] * inverse);
    }
    const double first = static_cast<double>(t_min), last = static_cast<double>(t_limit);
    least = static_cast<float>(((first - at.t) - 0x1p-22 * __builtin_fabs(first)) * length);
    most = static_cast<float>(((last - at.t) + 0x1p-22 * __builtin_fabs(last)) * length);
    away = static_cast<float>(largest_component(at.point));
    slack = static_cast<float>(0x1p-46 * (static_cast<double>(reach) + largest_component(ray.origin)) + 0x1p-60);
  }
};

struct Vector8 {
  Float8 x, y, z;
};
PERFECT_BVH_INLINE Float8 dot8(const Vector8& a, const Vector8& b) noexcept {
  return fmadd(a.z, b.z, fmadd(a.y, b.y, mul(a.x, b.x)));
}
PERFECT_BVH_INLINE Vector8 cross8(const Vector8& a, const Vector8& b) noexcept {
  return {fmsub(a.y, b.z, mul(a.z, b.y)), fmsub(a.z, b.x, mul(a.x, b.z)), fmsub(a.x, b.y, mul(a.y, b.x))};
}
PERFECT_BVH_INLINE Float8 largest8(const Vector8& a) noexcept { return max(max(abs(a.x), abs(a.y)), abs(a.z)); }

// Of centres, from the line's nearest point.
PERFECT_BVH_INLINE Vector8 from_line(const float (*rows)[8], const RoundFilter& filter) noexcept {
  const auto row = [&](int axis) __attribute__((always_inline)) {
    return sub(sub(load(rows[axis]), broadcast(filter.centre[axis])), broadcast(filter.nearest[axis]));
  };
  return {row(0), row(1), row(2)};
}

// The lanes that the ray may meet.
PERFECT_BVH_INLINE unsigned round_candidates(const GatheredBalls& leaf, const RoundFilter& filter) noexcept {
  const Vector8 direction{broadcast(filter.direction[0]), broadcast(filter.direction[1]),
                          broadcast(filter.direction[2])};
  const Vector8 first = from_line(leaf.first, filter), last = from_line(leaf.last, filter);
  const Float8 radius = max(load(leaf.first[3]), load(leaf.last[3]));
  const Float8 size = add(max(largest8(first), largest8(last)), add(broadcast(filter.away), radius));
  const Float8 reach = add(radius, fmadd(size, broadcast(kRoundSlack), broadcast(filter.slack)));
  const Vector8 k = cross8(direction, first), k1 = cross8(direction, last);
  const Vector8 e{sub(k1.x, k.x), sub(k1.y, k.y), sub(k1.z, k.z)};
  const float one = 1.0f, smallest = 0x1p-126f;  // no division by 0, whose NaN each processor treats differently
  const Float8 s = div(sub(zero(), dot8(k, e)), max(dot8(e, e), broadcast(smallest)));
  const Float8 share = min(max(s, zero()), broadcast(one));
  const Vector8 q{fmadd(share, e.x, k.x), fmadd(share, e.y, k.y), fmadd(share, e.z, k.z)};
  const Mask8 is_near = less_equal(dot8(q, q), mul(reach, reach));
  const Float8 depth = dot8(direction, first), depth1 = dot8(direction, last);
  const Mask8 in_range = both(less_equal(sub(min(depth, depth1), reach), broadcast(filter.most)),
                              less_equal(broadcast(filter.least), add(max(depth, depth1), reach)));
  return bits(both(is_near, in_range));
}

// A leaf's primitives: those that a ray may meet, once each.
struct RoundCandidates {
  RoundRay ray;
  unsigned lanes;

  RoundCandidates(const IndexedLeaf& leaf, const RoundList& list, const ObjectRay& local, float t_min, float t_limit,
                  float reach) noexcept
      : ray(round_ray(local.origin, local.direction)) {
    const std::uint32_t* const primitives = leaf.primitives;
    GatheredBalls balls;
    if (list.segments == nullptr) {
      const auto ball = [&](int lane) -> const Ball& { return list.balls[primitives[lane]]; };
      gather_balls(balls.first, list.scale, ball);
      __builtin_memcpy(balls.last, balls.first, sizeof(balls.first));
    } else {
      const Ball* begins[8];
      for (int lane = 0; lane < 8; ++lane) begins[lane] = list.balls + (list.segments[primitives[lane]] & kSegmentBall);
      gather_balls(balls.first, list.scale, [&](int lane) -> const Ball& { return begins[lane][0]; });
      gather_balls(balls.last, list.scale, [&](int lane) -> const Ball& { return begins[lane][1]; });
    }
    lanes = round_candidates(balls, RoundFilter(balls, ray, t_min, t_limit, reach));
    for (int lane = 1; lanes != 0 && lane < 8; ++lane) {
      if (primitives[lane] == primitives[lane - 1]) lanes &= ~(1u << lane);
    }
  }
};

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

inline float share_of(const RoundRay& ray, const RoundList& list, std::uint32_t primitive, double local_t) noexcept {
  if (list.segments == nullptr) return 0.0f;
  const RoundEnds ends = ends_of(list, primitive);
  return static_cast<float>(share_at(ray, ends.first, ends.last, local_t));
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
  const bool may_enter = cull != Cull::kFront && counts(meeting.entry);
  const bool may_exit = cull != Cull::kBack && counts(meeting.exit);
  if (!may_enter && !may_exit) return false;
  const ShownEnds shows = shown_ends(ray, list, primitive, meeting.chord);
  const bool is_entry = may_enter && shows.entry;
  if (!is_entry && !(may_exit && shows.exit)) return false;
  hit.t = is_entry ? meeting.entry : meeting.exit;
  hit.u = share_of(ray, list, primitive, is_entry ? meeting.chord.entry : meeting.chord.exit);
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
