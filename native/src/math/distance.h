// Finds the point of a triangle nearest to the origin, four triangles at a time, in double.
// There are three candidates on the edges and one inside, each a point of the triangle; the nearest wins. So the result
// is never less than the true distance, and if a needle's normal is only noise, its edges still give an answer.
// The operations are fixed, so that a triangle has the same distance in every lane and on every instruction set.
#pragma once

#include "math/curve_joint.h"
#include "math/double4.h"

namespace perfect_bvh {

struct Vectors4 {
  Double4 x, y, z;
};

PERFECT_BVH_LANES Vectors4 minus(const Vectors4& a, const Vectors4& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
PERFECT_BVH_LANES Double4 dot4(const Vectors4& a, const Vectors4& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
PERFECT_BVH_LANES Vectors4 cross4(const Vectors4& a, const Vectors4& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
PERFECT_BVH_LANES Vectors4 moved(const Vectors4& from, const Vectors4& along, const Double4& share) noexcept {
  return {from.x + along.x * share, from.y + along.y * share, from.z + along.z * share};
}

// The point is (1 - u - v) a + u b + v c; `squared` is its squared distance.
struct NearestOnTriangles {
  Double4 squared, u, v;

  PERFECT_BVH_LANES void offer(NearestOnTriangles& best, const Double4& squared, const Double4& u, const Double4& v,
                               const Mask4& allowed) noexcept {
    const Mask4 nearer = (squared < best.squared) & allowed;
    best.squared = nearer ? squared : best.squared;
    best.u = nearer ? u : best.u;
    best.v = nearer ? v : best.v;
  }
};

// Returns the position, 0 to 1, on the edge from `from` along `edge` that is nearest to the origin; 0 for an edge
// without length.
PERFECT_BVH_LANES Double4 nearest_share(const Vectors4& from, const Vectors4& edge) noexcept {
  const Double4 none = {0.0, 0.0, 0.0, 0.0}, whole = {1.0, 1.0, 1.0, 1.0};
  const Double4 share = -dot4(from, edge) / dot4(edge, edge);
  const Double4 positive = share > none ? share : none;  // NaN becomes 0
  return positive < whole ? positive : whole;
}

// The far end is that corner itself, so that triangles that share it have the same distance.
PERFECT_BVH_LANES Double4 edge_distance(const Vectors4& from, const Vectors4& to, const Vectors4& edge,
                                        const Double4& share) noexcept {
  const Vectors4 point = moved(from, edge, share);
  const Double4 whole = {1.0, 1.0, 1.0, 1.0};
  return share < whole ? dot4(point, point) : dot4(to, to);
}

PERFECT_BVH_LANES NearestOnTriangles nearest_to_origin(const Vectors4& a, const Vectors4& b,
                                                       const Vectors4& c) noexcept {
  const Double4 none = {0.0, 0.0, 0.0, 0.0}, whole = {1.0, 1.0, 1.0, 1.0};
  const Mask4 always = none == none;
  const Vectors4 to_b = minus(b, a), to_c = minus(c, a), across = minus(c, b);
  const Double4 along_b = nearest_share(a, to_b), along_c = nearest_share(a, to_c), between = nearest_share(b, across);
  NearestOnTriangles best{edge_distance(a, b, to_b, along_b), along_b, none};
  NearestOnTriangles::offer(best, edge_distance(a, c, to_c, along_c), none, along_c, always);
  NearestOnTriangles::offer(best, edge_distance(b, c, across, between), whole - between, between, always);
  const Vectors4 normal = cross4(to_b, to_c);
  const Double4 area = dot4(normal, normal);  // 0: u and v are NaN, and nothing is inside
  const Double4 u = dot4(cross4(to_c, a), normal) / area;
  const Double4 v = dot4(cross4(a, to_b), normal) / area;
  const Vectors4 inside = moved(moved(a, to_b, u), to_c, v);
  NearestOnTriangles::offer(best, dot4(inside, inside), u, v, (u >= none) & (v >= none) & (u + v <= whole));
  return best;
}

// Round distance ------------------------------------------------------------------------------------------------------
// Finds the point of a curve's segment, or of a point, that is nearest to a query point, by distances after a linear
// map M. The primitives are solid: if the query is inside, it is the nearest point, at distance 0. Scalar, in double
// precision.
//
// M turns spheres into ellipsoids. The hull is the union of the spheres of centre c(s) and radius r(s), s from 0 to 1
// (math/round_segment.h). The distance from a point q to the sphere of s is a convex function of s.
//
// One sphere: y, relative to its centre, minimizes |M (c + y) - q| with |y| <= r. Either the y that makes it 0 is not
// longer than r: then q is inside. Or |y| = r, and (M'M + l I) y = M'(q - M c) for one l > 0. That l is the root of
// 1/|y(l)| - 1/r, which Newton's method approaches from below (More and Sorensen 1983, on trust regions). It begins at
// the lower bound |M'(q - M c)| / r - |M'M|, which equals l if M only rotates, moves and scales.
//
// All spheres: with growing s, the distance decreases while y.a / |y| + d > 0, where a and d are the growth of c and r.
// If M is a similarity, y points from the axis straight to q, and the root s is known. Otherwise the root is enclosed
// by iteration.

// A linear map and values derived from it.
struct RoundPlace {
  double columns[3][3];
  double gram[3][3];  // M'M
  double bound;       // a bound of its norm
  bool is_similar;    // up to rounding
};

// Makes it from columns x, y, z.
static inline RoundPlace round_place(const double columns[9]) noexcept {
  RoundPlace place;
  for (int i = 0; i < 9; ++i) place.columns[i / 3][i % 3] = columns[i];
  place.bound = 0.0;
  for (int i = 0; i < 3; ++i) {
    double row = 0.0;
    for (int k = 0; k < 3; ++k) {
      place.gram[i][k] = dot_of(place.columns[i], place.columns[k]);
      row += __builtin_fabs(place.gram[i][k]);
    }
    place.bound = larger(place.bound, row);
  }
  double off = 0.0;
  for (int i = 0; i < 3; ++i) {
    const int next = (i + 1) % 3;
    off = larger(off, __builtin_fabs(place.gram[i][next]));
    off = larger(off, __builtin_fabs(place.gram[i][i] - place.gram[next][next]));
  }
  place.is_similar = off <= 0x1p-44 * place.bound;
  return place;
}

static inline void apply(const RoundPlace& place, const double v[3], double out[3]) noexcept {
  const auto& m = place.columns;
  for (int i = 0; i < 3; ++i) out[i] = fused(m[2][i], v[2], fused(m[1][i], v[1], m[0][i] * v[0]));
}
static inline void apply_transposed(const RoundPlace& place, const double v[3], double out[3]) noexcept {
  for (int i = 0; i < 3; ++i) out[i] = dot_of(place.columns[i], v);
}

struct NearestOnRound {
  double squared;   // the squared distance
  double u;         // along the segment
  double point[3];  // before the map
  bool is_inside;
};

// Factors a symmetric matrix, plus `added` on its diagonal, into L L'; returns false if it is not positive definite.
static inline bool factor(const double (&matrix)[3][3], double added, double (&l)[3][3]) noexcept {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k <= i; ++k) {
      double sum = matrix[i][k] + (i == k ? added : 0.0);
      for (int j = 0; j < k; ++j) sum -= l[i][j] * l[k][j];
      if (i == k && !(sum > 0.0)) return false;
      l[i][k] = i == k ? __builtin_sqrt(sum) : sum / l[k][k];
    }
  }
  return true;
}
// Solves L x = b.
static inline void solve_lower(const double (&l)[3][3], const double b[3], double x[3]) noexcept {
  for (int i = 0; i < 3; ++i) {
    x[i] = b[i];
    for (int j = 0; j < i; ++j) x[i] -= l[i][j] * x[j];
    x[i] /= l[i][i];
  }
}
// Solves L' x = b.
static inline void solve_upper(const double (&l)[3][3], const double b[3], double x[3]) noexcept {
  for (int i = 2; i >= 0; --i) {
    x[i] = b[i];
    for (int j = i + 1; j < 3; ++j) x[i] -= l[j][i] * x[j];
    x[i] /= l[i][i];
  }
}

// Finds the y above for one sphere, and its direction `way` of length 1. Returns false if q is inside. `pull`: M'(q - M
// c).
static inline bool nearest_in_ball(const RoundPlace& place, const double pull[3], double radius, double y[3],
                                   double way[3]) noexcept {
  const double force = __builtin_sqrt(dot_of(pull, pull));
  for (int i = 0; i < 3; ++i) y[i] = 0.0, way[i] = force > 0.0 ? pull[i] / force : 0.0;
  if (!(radius > 0.0)) return force > 0.0;
  double added = larger(force / radius - place.bound, 0.0);
  constexpr int kMostSteps = 50;  // about 6 are needed; each is nearer
  for (int step = 0; step < kMostSteps; ++step) {
    double lower[3][3], half[3];
    if (!factor(place.gram, added, lower)) {  // M almost flattens space
      added = larger(2.0 * added, 0x1p-50 * place.bound);
      if (!(added > 0.0)) return false;
      continue;
    }
    solve_lower(lower, pull, half);
    solve_upper(lower, half, y);
    const double length = __builtin_sqrt(dot_of(y, y));
    if (added == 0.0 && length <= radius) return false;
    solve_lower(lower, y, half);
    const double more = (length - radius) / radius * (length * length / dot_of(half, half));
    for (int i = 0; i < 3; ++i) way[i] = y[i] / length, y[i] = way[i] * radius;
    if (!(more > 0x1p-50 * added)) return true;
    added += more;
  }
  return true;
}

// Finds the nearest point in the sphere of s. Returns true if q is inside.
static inline bool nearest_at(const RoundPlace& place, const RoundBall& first, const RoundCone& cone,
                              const double query[3], double s, NearestOnRound& nearest, double way[3]) noexcept {
  double centre[3], mapped[3], away[3], pull[3], y[3];
  for (int i = 0; i < 3; ++i) centre[i] = fused(s, cone.axis[i], first.centre[i]);
  apply(place, centre, mapped);
  for (int i = 0; i < 3; ++i) away[i] = query[i] - mapped[i];
  apply_transposed(place, away, pull);
  const double radius = fused(s, cone.widening, first.radius);
  nearest.u = s;
  nearest.is_inside = !nearest_in_ball(place, pull, radius, y, way);
  nearest.squared = 0.0;
  if (nearest.is_inside) return true;
  apply(place, y, mapped);
  for (int i = 0; i < 3; ++i) away[i] -= mapped[i], nearest.point[i] = centre[i] + y[i];
  nearest.squared = dot_of(away, away);
  return false;
}

// M must be a similarity.
static inline double nearest_share_of(const RoundPlace& place, const RoundBall& first, const RoundCone& cone,
                                      const double query[3]) noexcept {
  double mapped[3], away[3], from[3], across[3];
  apply(place, first.centre, mapped);
  for (int i = 0; i < 3; ++i) away[i] = query[i] - mapped[i];
  apply_transposed(place, away, from);
  for (double& component : from) component /= place.gram[0][0];
  cross_of(from, cone.axis, across);
  const double length = dot_of(cone.axis, cone.axis);
  const double slope = cone.widening / __builtin_sqrt(cone.squared);
  return (dot_of(from, cone.axis) + __builtin_sqrt(dot_of(across, across)) * slope) / length;
}

// query: the mapped query point, relative to the mapped origin.
static inline NearestOnRound nearest_on_round(const RoundPlace& place, const RoundEnds& ends,
                                              const double query[3]) noexcept {
  const RoundCone cone = cone_of(ends.first, ends.last);
  NearestOnRound nearest;
  double way[3];
  // The negative rate of change of the distance with s: the distance decreases where this is positive.
  const auto rise = [&] { return dot_of(way, cone.axis) + cone.widening; };
  if (!(cone.squared > 0.0)) {  // one sphere contains the other
    nearest_at(place, ends.first, cone, query, cone.widening > 0.0 ? 1.0 : 0.0, nearest, way);
    return nearest;
  }
  if (place.is_similar) {
    const double s = nearest_share_of(place, ends.first, cone, query);
    nearest_at(place, ends.first, cone, query, s > 0.0 ? smaller(s, 1.0) : 0.0, nearest, way);
    return nearest;
  }
  double low = 0.0, high = 1.0;
  if (nearest_at(place, ends.first, cone, query, low, nearest, way)) return nearest;
  double at_low = rise();
  if (!(at_low > 0.0)) return nearest;
  if (nearest_at(place, ends.first, cone, query, high, nearest, way)) return nearest;
  double at_high = rise();
  if (!(at_high < 0.0)) return nearest;
  // The Illinois method (an end that stays twice counts half), with a bisection every fourth step.
  constexpr int kMostSteps = 200;
  bool was_low = false, was_high = false;
  for (int step = 0; step < kMostSteps && high - low > 0x1p-50; ++step) {
    const double between = low + (high - low) * (at_low / (at_low - at_high));
    const double s = step % 4 == 3 || !(between > low && between < high) ? 0.5 * (low + high) : between;
    if (nearest_at(place, ends.first, cone, query, s, nearest, way)) return nearest;
    const double here = rise();
    if (here == 0.0) break;
    if (here > 0.0) {
      if (was_low) at_high *= 0.5;
      low = s, at_low = here, was_low = true, was_high = false;
    } else {
      if (was_high) at_low *= 0.5;
      high = s, at_high = here, was_high = true, was_low = false;
    }
  }
  return nearest;
}

}  // namespace perfect_bvh
