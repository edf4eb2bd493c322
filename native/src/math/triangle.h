// The watertight ray/triangle test, scalar reference: kernels compute the same bits, eight triangles at a time.
// The triangle is sheared so that the ray becomes the z axis through the origin (Woop, Benthin, Wald 2013). Which side
// of an edge the origin lies on is a difference of two products of coordinates that both triangles at the edge compute
// alike; it is formed with the products' rounding errors recovered (Kahan's product difference), so that its sign is
// right, and zero only if it is zero. So no ray passes between two triangles that share an edge, or through a vertex
// of a closed mesh. Products that underflow may be taken for zero, which counts as inside: still no gap.
//
// The weights of the sheared corners say whether there is a hit, and what u and v are; t comes from the triangle's
// plane, in double, and is the float nearest to it: the corners' depths, weighted, would be off by a few roundings of
// the corners' distance, which on a ground of kilometres is centimetres.
// Beside an edge the sheared ray, which is a rounding away from the ray itself, may meet a triangle that the ray passes
// by. A plane that is seen almost edge-on is then anywhere, before the faces in front of it or behind the ray's origin,
// and the weighted corners, which all triangles at the edge have in common, are what t comes from. Why no box loses a
// hit: math/slab.h.
#pragma once

#include <cstdint>

#include "math/slab.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct TriangleRay {
  float origin[3];  // along the axes x, y and z of the sheared frame
  float shear_x, shear_y;
  float direction_z;
  float depth_slack;     // how far t may be from every depth of the triangle's
  float edge_slack;      // how far from an edge a hit is surely not beside it, in the sheared frame
  std::uint8_t axes[3];  // which axes of the mesh are x, y and z: z is the direction's longest, x the one after it
  bool runs_down;        // direction_z < 0: then a triangle of positive weights shows its back, otherwise its front
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
  ray.edge_slack = kEdgeReach * extent.reach;
  ray.depth_slack = kDepthReach * ((extent.largest[longest] + magnitude(origin[longest])) * magnitude(inverse));
  ray.runs_down = direction[longest] < 0.0f;
}

// A triangle's plane in the mesh's own frame, by a point of it and its normal.
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

// No edge is longer.
static inline double span_of(const float a[3], const float b[3], const float c[3]) noexcept {
  double span = 0.0;
  for (int i = 0; i < 3; ++i) {
    span += __builtin_fabs(static_cast<double>(b[i]) - static_cast<double>(a[i])) +
            __builtin_fabs(static_cast<double>(c[i]) - static_cast<double>(a[i]));
  }
  return span;
}

// How far the plane is from a point, times the length of the normal.
static inline double plane_away(const TrianglePlane& plane, const double from[3]) noexcept {
  const double *const n = plane.normal, *const p = plane.point;
  return (n[0] * (p[0] - from[0]) + n[1] * (p[1] - from[1])) + n[2] * (p[2] - from[2]);
}

// Where a ray in the mesh's own frame, not sheared, meets the plane. Not finite if the plane holds its direction.
static inline double plane_t(const TrianglePlane& plane, const double origin[3], const double direction[3]) noexcept {
  const double* const n = plane.normal;
  return plane_away(plane, origin) / ((n[0] * direction[0] + n[1] * direction[1]) + n[2] * direction[2]);
}

// Outside of an edge by no more than this share of the triangle's height over it counts as inside: rounding does it.
inline constexpr double kBeside = 0x1p-40;

// Whether the ray's point at `t`, in the plane, lies in the triangle.
static inline bool is_inside(const TrianglePlane& plane, const float* const corners[3], const double origin[3],
                             const double direction[3], double t) noexcept {
  const double* const n = plane.normal;
  double to[3][3];
  for (int corner = 0; corner < 3; ++corner) {
    for (int i = 0; i < 3; ++i) {
      to[corner][i] = static_cast<double>(corners[corner][i]) - (origin[i] + t * direction[i]);
    }
  }
  const double least = -kBeside * ((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]);
  for (int corner = 0; corner < 3; ++corner) {
    const double *const v = to[corner], *const w = to[corner == 2 ? 0 : corner + 1];
    const double side =
        (n[0] * (v[1] * w[2] - v[2] * w[1]) + n[1] * (v[2] * w[0] - v[0] * w[2])) + n[2] * (v[0] * w[1] - v[1] * w[0]);
    if (!(side >= least)) return false;
  }
  return true;
}

// The corners' depths along the sheared z, weighted; the weights need not sum to 1.
static inline float weighted_t(const TriangleRay& ray, const float weights[3], float sum, const float z[3]) noexcept {
  const float depth = __builtin_fmaf(weights[2], z[2], __builtin_fmaf(weights[1], z[1], weights[0] * z[0]));
  return depth / (sum * ray.direction_z);
}

// t of a hit: that of the plane if the ray's point there lies in the triangle, or else that of the weighted corners.
static inline float settle_t(const TriangleRay& ray, const TrianglePlane& plane, const float* const corners[3],
                             const double origin[3], const double direction[3], const float weights[3], float sum,
                             const float z[3]) noexcept {
  const double exact = plane_t(plane, origin, direction);
  return is_inside(plane, corners, origin, direction, exact) ? static_cast<float>(exact)
                                                             : weighted_t(ray, weights, sum, z);
}

struct TriangleHit {
  float t, u, v;  // the point is (1 - u - v) v0 + u v1 + v v2
  bool is_front;  // counter-clockwise as seen from the ray's origin, in the mesh's own frame
};

// a * b - c * d, within 2 u, its sign right.
static inline float product_difference(float a, float b, float c, float d) noexcept {
  const float product = c * d;
  return __builtin_fmaf(a, b, -product) + __builtin_fmaf(-c, d, product);
}

// True if the ray's line passes through the triangle: edges and vertices count, triangles seen exactly edge-on do not.
// origin, direction: what `ray` was made of, before it was narrowed to float.
static inline bool intersect_triangle(const TriangleRay& ray, const double origin[3], const double direction[3],
                                      const float* const corners[3], TriangleHit& hit) noexcept {
  float p[3][3], x[3], y[3], z[3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) p[i][k] = corners[i][ray.axes[k]];
    z[i] = p[i][2] - ray.origin[2];
    x[i] = __builtin_fmaf(-ray.shear_x, z[i], p[i][0] - ray.origin[0]);
    y[i] = __builtin_fmaf(-ray.shear_y, z[i], p[i][1] - ray.origin[1]);
  }
  const float a = product_difference(x[2], y[1], y[2], x[1]);
  const float b = product_difference(x[0], y[2], y[0], x[2]);
  const float c = product_difference(x[1], y[0], y[1], x[0]);
  const float least = smaller(smaller(a, b), c), most = larger(larger(a, b), c);
  if (!(least >= 0.0f || most <= 0.0f)) return false;
  const float sum = (a + b) + c;
  if (sum == 0.0f) return false;
  const float weights[3] = {a, b, c};
  const TrianglePlane plane = plane_of(corners[0], corners[1], corners[2]);
  hit.t = settle_t(ray, plane, corners, origin, direction, weights, sum, z);
  hit.u = b / sum;
  hit.v = c / sum;
  hit.is_front = (sum > 0.0f) != ray.runs_down;
  return true;
}

}  // namespace perfect_bvh
