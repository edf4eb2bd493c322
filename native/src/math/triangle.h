// The watertight ray/triangle test, scalar reference. Kernels compute the same bits, eight triangles at a time.
// The triangle is sheared so that the ray becomes the z axis through the origin (Woop, Benthin, Wald 2013). The side of
// an edge that the origin is on is a difference of two products of coordinates, which both triangles at the edge
// compute alike. The products' rounding errors are recovered (Kahan's product difference), so the sign is right, and
// the result is zero only if it is exactly zero. So no ray passes between two triangles that share an edge, or through
// a vertex of a closed mesh.
//
// The test in float decides if the origin is farther from every edge than rounding moves a corner. Near an edge it is
// repeated in double, from the ray before it was narrowed, by the same rule. If double cannot decide either, it is done
// exactly (math/exact_edges.h). As a result, a ray hits a triangle if and only if, in exact arithmetic on the ray in
// the mesh's space and the triangle's corners, its line meets the closed triangle. Edges and vertices count; rays in
// the triangle's plane do not. The corners are those that the tree stores. Meshes that reach beyond 2^20 lose detail
// below 2^-126 of the reach (tree_scale() in wide/wide_bvh.h); others lose nothing.
//
// t is the float nearest to where the ray hits the triangle's plane, in double. The weighted depths of the corners in
// float would be off by a few roundings of the corners' distance, which is centimetres on a ground of kilometres. Near
// an edge, t comes from the weighted depths in double, or from exact arithmetic if these are not precise to a float:
// the plane of a triangle that is seen almost edge-on, where every point is near an edge, could be anywhere. For why no
// box loses a hit, see math/slab.h.
// loses a hit: math/slab.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "math/exact_edges.h"
#include "math/slab.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct TriangleRay {
  float origin[3];  // along the axes x, y and z of the sheared frame
  float shear_x, shear_y;
  float direction_z;
  float depth_slack;     // how far t may be from all depths of the triangle
  float edge_slack;      // distance from an edge at which float is sure of the side, in the sheared frame
  std::uint8_t axes[3];  // the mesh's axes for x, y and z: z is the direction's longest, x the one after it
  bool runs_down;        // direction_z < 0: a triangle of positive weights then shows its back, otherwise its front
};

static inline void set_triangle_ray(TriangleRay& ray, const float origin[3], const float direction[3], int longest,
                                    const TreeExtent& extent) noexcept {
  constexpr std::uint8_t kAxes[5] = {1, 2, 0, 1, 2};
  ray.axes[0] = kAxes[longest], ray.axes[1] = kAxes[longest + 1], ray.axes[2] = static_cast<std::uint8_t>(longest);
  const float inverse = 1.0f / direction[longest];
  for (int i = 0; i < 3; ++i) ray.origin[i] = origin[ray.axes[i]];
  ray.shear_x = direction[ray.axes[0]] * inverse;
  ray.shear_y = direction[ray.axes[1]] * inverse;
  ray.direction_z = direction[longest];
  float reach = 0.0f;
  for (int i = 0; i < 3; ++i) reach = larger(reach, extent.largest[i] + magnitude(origin[i]));
  ray.edge_slack = kEdgeReach * reach;
  ray.depth_slack = kDepthReach * ((extent.largest[longest] + magnitude(origin[longest])) * magnitude(inverse));
  ray.runs_down = direction[longest] < 0.0f;
}

// A triangle's plane in the mesh's own frame, given by a point of it and its normal.
struct TrianglePlane {
  double point[3], normal[3];
};

static inline TrianglePlane plane_of(const float a[3], const float b[3], const float c[3]) noexcept {
  TrianglePlane plane;
  double to_b[3], to_c[3];
  for (int i = 0; i < 3; ++i) {
    plane.point[i] = static_cast<double>(a[i]);
    to_b[i] = static_cast<double>(b[i]) - plane.point[i];
    to_c[i] = static_cast<double>(c[i]) - plane.point[i];
  }
  plane.normal[0] = to_b[1] * to_c[2] - to_b[2] * to_c[1];
  plane.normal[1] = to_b[2] * to_c[0] - to_b[0] * to_c[2];
  plane.normal[2] = to_b[0] * to_c[1] - to_b[1] * to_c[0];
  return plane;
}

// Returns the sum of the extents of its box; no edge is longer.
static inline double span_of(const float a[3], const float b[3], const float c[3]) noexcept {
  double span = 0.0;
  for (int i = 0; i < 3; ++i) {
    const float least = smaller(smaller(a[i], b[i]), c[i]), most = larger(larger(a[i], b[i]), c[i]);
    span += static_cast<double>(most) - static_cast<double>(least);
  }
  return span;
}

// Returns the distance of the plane from a point, times the length of the normal.
static inline double plane_away(const TrianglePlane& plane, const double from[3]) noexcept {
  const double *const n = plane.normal, *const p = plane.point;
  return (n[0] * (p[0] - from[0]) + n[1] * (p[1] - from[1])) + n[2] * (p[2] - from[2]);
}

// Returns where a ray in the mesh's own frame, not sheared, meets the plane. Not finite if the direction is parallel to
// it.
static inline double plane_t(const TrianglePlane& plane, const double origin[3], const double direction[3]) noexcept {
  const double* const n = plane.normal;
  return plane_away(plane, origin) / ((n[0] * direction[0] + n[1] * direction[1]) + n[2] * direction[2]);
}

struct TriangleHit {
  float t, u, v;  // the point is (1 - u - v) v0 + u v1 + v v2
  bool is_front;  // counter-clockwise as seen from the ray's origin, in the mesh's own frame
};

static inline float fused(float a, float b, float c) noexcept { return __builtin_fmaf(a, b, c); }
static inline double fused(double a, double b, double c) noexcept { return __builtin_fma(a, b, c); }

// Returns a * b - c * d, within 2 u and with the right sign.
template <class Real>
static inline Real product_difference(Real a, Real b, Real c, Real d) noexcept {
  const Real product = c * d;
  return fused(a, b, -product) + fused(-c, d, product);
}

// Returns the distance from zero at which the sign of a weight is sure. A weight is the distance of an edge times the
// edge's length. Each end of the edge may be off by 14.2 of the 28 units of edge_slack (math/slab.h). So may its
// distance, and the length is at most 1.74 spans plus twice that. The second part matters for triangles that are tiny
// compared with their mesh's reach.
template <class Real>
static inline Real weight_slack(Real edge_slack, Real span) noexcept {
  return edge_slack * (span + edge_slack);
}

// A triangle in a ray's sheared frame: its corners, and the weight of each at the point where the ray passes. A weight
// is negative on the far side of the opposite edge (for triangles that turn clockwise there: positive).
template <class Real>
struct ShearedTriangle {
  Real x[3], y[3], z[3], weights[3], sum, least, most;
};

// Coordinate `axis` of corner i is at(i, axis).
template <class Real, class Corners>
static inline void set_sheared(ShearedTriangle<Real>& triangle, const Corners& at, const Real origin[3], Real shear_x,
                               Real shear_y) noexcept {
  Real *const x = triangle.x, *const y = triangle.y, *const w = triangle.weights;
  for (int i = 0; i < 3; ++i) {
    const Real z = at(i, 2) - origin[2];
    x[i] = fused(-shear_x, z, at(i, 0) - origin[0]);
    y[i] = fused(-shear_y, z, at(i, 1) - origin[1]);
    triangle.z[i] = z;
  }
  w[0] = product_difference(x[2], y[1], y[2], x[1]);
  w[1] = product_difference(x[0], y[2], y[0], x[2]);
  w[2] = product_difference(x[1], y[0], y[1], x[0]);
  triangle.sum = (w[0] + w[1]) + w[2];
  triangle.least = smaller(smaller(w[0], w[1]), w[2]);
  triangle.most = larger(larger(w[0], w[1]), w[2]);
}

// A ray in the mesh's own frame. `origin` is near the mesh; `start` is where the ray begins. They are equal, unless the
// ray was moved along its direction, which involves rounding.
struct ExactRay {
  const double *origin, *direction, *start;
};

// The distance at which double is sure of its side, relative to that of float, by the rounding analysis of math/slab.h;
// and the addition for each unit that the origin was moved.
inline constexpr double kDoubleShare = 0x1p-29, kMovedShare = 0x1p-50;
// If each weight is off by no more than this share of the volume between triangle and origin, divided by the depth of
// the triangle, t is off by less than half a unit in the last place of a float.
inline constexpr double kSureShare = 0x1p-27;

// Returns whether a ray's angle to a triangle's plane is at most about kGrazingSine. `sum`: of the weights. If the ray
// was moved, its origin is not quite on its line, and t of the plane would be off by that divided by the angle.
inline constexpr float kGrazingSine = 0x1p-20f;
static inline float grazing_sum(float span) noexcept { return kGrazingSine * (span * span); }
static inline bool is_grazed(float sum, float span) noexcept { return magnitude(sum) <= grazing_sum(span); }

static inline bool intersect_exactly(const TriangleRay& sheared, const ExactRay& ray, const float* const corners[3],
                                     TriangleHit& hit) noexcept {
  const ExactWeights exact = exact_weights(ray.start, ray.direction, corners);
  if (!exact.is_hit) return false;
  const double sum = (exact.w[0] + exact.w[1]) + exact.w[2];
  if (ray.start == ray.origin) {
    hit.t = static_cast<float>(-exact_volume(ray.origin, corners) / sum);
  } else {  // from the weights, which are within the triangle
    const int z = sheared.axes[2];
    const auto depth = [&](int i) { return static_cast<double>(corners[i][z]) - ray.origin[z]; };
    const double volume = (exact.w[0] * depth(0) + exact.w[1] * depth(1)) + exact.w[2] * depth(2);
    hit.t = static_cast<float>(volume / (sum * ray.direction[z]));
  }
  hit.u = static_cast<float>(exact.w[1] / sum);
  hit.v = static_cast<float>(exact.w[2] / sum);
  hit.is_front = sum > 0.0;
  return true;
}

// Depths along the sheared z, in the ray's order or against it. A hit outside is rejected.
struct DepthRange {
  float least, most;
};

// Returns whether a triangle, whose weights are off by at most `slack`, is out of the range if it is hit. The depth of
// the point moves by at most three times the slack times the triangle's own depth, divided by the weights' sum.
static inline bool is_out_of_range(const ShearedTriangle<double>& triangle, double volume, double depth, double slack,
                                   const DepthRange& range) noexcept {
  const double *const z = triangle.z, sum = __builtin_fabs(triangle.sum);
  const double far = larger(larger(__builtin_fabs(z[0]), __builtin_fabs(z[1])), __builtin_fabs(z[2]));
  const double at = volume / triangle.sum, off = (3.0 * slack * depth + 0x1p-40 * far * (sum + slack)) / sum;
  return at + off < static_cast<double>(range.least) || at - off > static_cast<double>(range.most);
}

// Decides near an edge. May report a miss for a hit out of the range.
static inline bool intersect_beside_edge(const TriangleRay& sheared, const ExactRay& ray, const float* const corners[3],
                                         const DepthRange& range, TriangleHit& hit) noexcept {
  const std::uint8_t* const axes = sheared.axes;
  const double *const origin = ray.origin, *const direction = ray.direction;
  const double from[3] = {origin[axes[0]], origin[axes[1]], origin[axes[2]]}, along = direction[axes[2]];
  const auto at = [&](int corner, int axis) { return static_cast<double>(corners[corner][axes[axis]]); };
  ShearedTriangle<double> triangle;
  set_sheared(triangle, at, from, direction[axes[0]] / along, direction[axes[1]] / along);
  double moved = 0.0;
  for (int axis = 0; axis < 3; ++axis) moved = larger(moved, __builtin_fabs(ray.start[axis] - origin[axis]));
  const double sure = kDoubleShare * static_cast<double>(sheared.edge_slack) + kMovedShare * moved;
  const double slack = weight_slack(sure, span_of(corners[0], corners[1], corners[2]));
  const double least_weight = larger(triangle.least, -triangle.most);
  if (least_weight < -slack) return false;
  const double *const w = triangle.weights, *const z = triangle.z, sum = triangle.sum;
  const double volume = (w[0] * z[0] + w[1] * z[1]) + w[2] * z[2];
  const double depth = larger(larger(z[0], z[1]), z[2]) - smaller(smaller(z[0], z[1]), z[2]);
  const bool tells_t = slack * depth <= kSureShare * __builtin_fabs(volume);
  if (!(least_weight > slack && tells_t)) {
    return !is_out_of_range(triangle, volume, depth, slack, range) && intersect_exactly(sheared, ray, corners, hit);
  }
  hit.t = static_cast<float>(volume / (sum * along));
  hit.u = static_cast<float>(w[1] / sum);
  hit.v = static_cast<float>(w[2] / sum);
  hit.is_front = (sum > 0.0) != (along < 0.0);
  return true;
}

// Returns true if the ray's line passes through the triangle: edges and vertices count, triangles seen exactly edge-on
// do not. exact: the original of `ray` before it was narrowed to float.
static inline bool intersect_triangle(const TriangleRay& ray, const ExactRay& exact, const float* const corners[3],
                                      TriangleHit& hit) noexcept {
  const auto at = [&](int corner, int axis) { return corners[corner][ray.axes[axis]]; };
  ShearedTriangle<float> triangle;
  set_sheared(triangle, at, ray.origin, ray.shear_x, ray.shear_y);
  const auto span = static_cast<float>(span_of(corners[0], corners[1], corners[2]));
  const float slack = weight_slack(ray.edge_slack, span);
  if (!(larger(triangle.least, -triangle.most) > slack)) {
    constexpr float kAnywhere = __builtin_inff();
    return intersect_beside_edge(ray, exact, corners, {-kAnywhere, kAnywhere}, hit);
  }
  const float sum = triangle.sum;
  if (exact.start != exact.origin && is_grazed(sum, span)) return intersect_exactly(ray, exact, corners, hit);
  hit.t = static_cast<float>(plane_t(plane_of(corners[0], corners[1], corners[2]), exact.origin, exact.direction));
  hit.u = triangle.weights[1] / sum;
  hit.v = triangle.weights[2] / sum;
  hit.is_front = (sum > 0.0f) != ray.runs_down;
  return true;
}

// Triangle ambiguity --------------------------------------------------------------------------------------------------
// Tests a ray against a triangle in double precision, with explicit rounding bounds, to judge the float kernels.
// In: a triangle's corners and a ray in world space, and how far rounding may have moved the ray (`margin`, world
// units). Out: surely hit (inside all three edges by more than the margin), surely missed, or neither; t, and how much
// a right answer may differ from it.

inline constexpr double kFloatUlp = 0x1p-24, kLeastFloat = 0x1p-149;
// The error of double precision, as a share of the margin, which is that of float.
inline constexpr double kDoubles = 0x1p-22;

struct JudgedRay {
  Vec3d origin, direction;
  double squared_length;  // of the direction
  double reach;           // largest |coordinate| of the origin

  JudgedRay(Vec3d the_origin, Vec3d the_direction) noexcept
      : origin(the_origin),
        direction(the_direction),
        squared_length(dot(the_direction, the_direction)),
        reach(std::max({std::abs(the_origin.x), std::abs(the_origin.y), std::abs(the_origin.z)})) {}
};

struct JudgedTriangle {
  Vec3d corners[3];
  Vec3d normal;         // by the winding; its length is twice the area
  double squared_area;  // squared length of `normal`
  Vec3d centre;
  double radius;  // of a sphere about the centre that contains the triangle

  JudgedTriangle(Vec3d a, Vec3d b, Vec3d c) noexcept
      : corners{a, b, c},
        normal(cross(b - a, c - a)),
        squared_area(dot(normal, normal)),
        centre((a + b + c) * (1.0 / 3.0)),
        radius(std::sqrt(
            std::max({dot(a - centre, a - centre), dot(b - centre, b - centre), dot(c - centre, c - centre)}))) {}
};

struct JudgedHit {
  bool surely_hit = false, surely_missed = false;
  bool has_t = false;  // a triangle seen almost edge-on has no meaningful t
  bool is_front = false;
  double t = 0, bound = 0;
};

// Returns whether the ray's line misses the sphere by more than the margin. Far cheaper than judge_triangle().
[[nodiscard]] inline bool passes_by(const JudgedRay& ray, Vec3d centre, double radius, double margin) noexcept {
  const Vec3d moment = cross(centre - ray.origin, ray.direction);
  const double distance = radius + margin;
  return dot(moment, moment) > distance * distance * ray.squared_length;
}

[[nodiscard]] inline JudgedHit judge_triangle(const JudgedRay& ray, const JudgedTriangle& triangle,
                                              double margin) noexcept {
  JudgedHit result;
  if (passes_by(ray, triangle.centre, triangle.radius, margin)) {
    result.surely_missed = true;
    return result;
  }
  // A needle's normal, which is rounded by 2^-52 of its length and distance, would also be noise.
  const double least_area = triangle.radius * (0x1p-28 * triangle.radius + 0x1p-4 * margin);
  if (!(triangle.squared_area > least_area * least_area)) return result;
  const double facing = dot(ray.direction, triangle.normal);
  // The cosine of ray and normal is below 1e-6: the signs of the edges' distances would be noise.
  if (!(facing * facing > 1e-12 * ray.squared_length * triangle.squared_area)) return result;
  const Vec3d from_origin[3] = {triangle.corners[0] - ray.origin, triangle.corners[1] - ray.origin,
                                triangle.corners[2] - ray.origin};
  result.t = dot(triangle.normal, from_origin[0]) / facing;
  const double rounding = 2.0 * kFloatUlp * std::abs(result.t) + kLeastFloat;
  const double moved = margin * std::sqrt(triangle.squared_area) / std::abs(facing);
  result.bound = rounding + moved;
  if (!std::isfinite(result.t) || !std::isfinite(result.bound)) return result;
  result.has_t = true;
  result.is_front = facing < 0;
  int inside = 0;
  for (int i = 0; i < 3; ++i) {
    // Uses the side from its corners: as a difference of two long vectors, the side of a tiny triangle would be lost.
    const Vec3d side = triangle.corners[(i + 1) % 3] - triangle.corners[i];
    const double volume = dot(cross(from_origin[i], side), ray.direction) * (facing > 0 ? 1.0 : -1.0);
    const Vec3d across = cross(side, ray.direction);
    if (!(volume * volume > margin * margin * dot(across, across))) continue;  // within the margin of this side
    inside += volume > 0 ? 1 : 0;
    result.surely_missed |= volume < 0;
  }
  result.surely_hit = inside == 3;
  if (result.surely_hit) result.bound = rounding + kDoubles * moved;  // t is that of the plane
  return result;
}

}  // namespace perfect_bvh
