// The watertight ray/triangle test, scalar reference: kernels compute the same bits, eight triangles at a time.
// The triangle is sheared so that the ray becomes the z axis through the origin (Woop, Benthin, Wald 2013). Which side
// of an edge the origin lies on is a difference of two products of coordinates that both triangles at the edge compute
// alike; it is formed with the products' rounding errors recovered (Kahan's product difference), so that its sign is
// right, and zero only if it is zero. So no ray passes between two triangles that share an edge, or through a vertex
// of a closed mesh. Products that underflow may be taken for zero, which counts as inside: still no gap.
// How far t may be from the truth, and why no box loses it: math/slab.h.
#pragma once

#include <cstdint>

#include "math/slab.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct TriangleRay {
  float origin[3];  // along the axes x, y and z of the sheared frame
  float shear_x, shear_y;
  float direction_z;
  // Below this |t| is computed again in double, so that a ray from a point of the triangle's plane meets it at 0.
  float refine_below;
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
  ray.refine_below = kRefineReach * ((extent.largest[longest] + magnitude(origin[longest])) * magnitude(inverse));
  ray.runs_down = direction[longest] < 0.0f;
}

// t by the plane equation in double, for a hit that the sheared test found at `t`; it moves by refine_below at most.
// The corners, like the ray's origin, are given along the sheared frame's axes.
static inline float refine_t(const TriangleRay& ray, const float a[3], const float b[3], const float c[3],
                             float t) noexcept {
  double to_b[3], to_c[3], to_a[3];
  for (int i = 0; i < 3; ++i) {
    to_b[i] = static_cast<double>(b[i]) - static_cast<double>(a[i]);
    to_c[i] = static_cast<double>(c[i]) - static_cast<double>(a[i]);
    to_a[i] = static_cast<double>(a[i]) - static_cast<double>(ray.origin[i]);
  }
  const double nx = to_b[1] * to_c[2] - to_b[2] * to_c[1];
  const double ny = to_b[2] * to_c[0] - to_b[0] * to_c[2];
  const double nz = to_b[0] * to_c[1] - to_b[1] * to_c[0];
  // The ray as the shear sees it: direction (shear_x, shear_y, 1), t in multiples of direction_z.
  const double speed = nx * static_cast<double>(ray.shear_x) + ny * static_cast<double>(ray.shear_y) + nz;
  const double refined = (nx * to_a[0] + ny * to_a[1] + nz * to_a[2]) / (speed * static_cast<double>(ray.direction_z));
  const float lowest = t - ray.refine_below, highest = t + ray.refine_below;
  const float narrowed = static_cast<float>(refined);
  if (!(narrowed >= lowest)) return refined < static_cast<double>(lowest) ? lowest : t;  // NaN: the plane holds the ray
  return narrowed <= highest ? narrowed : highest;
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
static inline bool intersect_triangle(const TriangleRay& ray, const float* const corners[3],
                                      TriangleHit& hit) noexcept {
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
  const float depth = __builtin_fmaf(c, z[2], __builtin_fmaf(b, z[1], a * z[0]));
  hit.t = depth / (sum * ray.direction_z);
  if (magnitude(hit.t) <= ray.refine_below) hit.t = refine_t(ray, p[0], p[1], p[2], hit.t);
  hit.u = b / sum;
  hit.v = c / sum;
  hit.is_front = (sum > 0.0f) != ray.runs_down;
  return true;
}

}  // namespace perfect_bvh
