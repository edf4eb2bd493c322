// The watertight ray/triangle test, scalar reference (Woop, Benthin, Wald 2013).
// The triangle is sheared so that the ray becomes the z axis through the origin; which side of each edge the origin
// lies on is then a 2x2 determinant of coordinates that both triangles at the edge compute alike. The determinants
// are formed in double, where a product of two floats is exact: their sign is right, and zero only if it is zero.
// So no ray passes between two triangles that share an edge, or through a vertex of a closed mesh.
#pragma once

#include <cmath>
#include <utility>

#include "math/slab.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct TriangleHit {
  float t, u, v;
};

struct TriangleRay {
  Vec3f origin;
  Vec3f direction;
  int x_axis, y_axis, z_axis;  // z_axis: the direction's largest component
  float shear_x, shear_y;
  bool flips_winding;  // the permutation of the axes mirrors, as seen along the ray

  TriangleRay(Vec3f ray_origin, Vec3f ray_direction) noexcept : origin(ray_origin), direction(ray_direction) {
    const float ax = std::abs(direction.x), ay = std::abs(direction.y), az = std::abs(direction.z);
    z_axis = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
    x_axis = (z_axis + 1) % 3;
    y_axis = (x_axis + 1) % 3;
    shear_x = direction[x_axis] / direction[z_axis];
    shear_y = direction[y_axis] / direction[z_axis];
    flips_winding = direction[z_axis] < 0.0f;
  }
};

// Sign convention: front faces are counter-clockwise as seen from the ray's origin.
enum class Facing : unsigned char { kFront, kBack };

namespace detail {
struct Sheared {
  float x, y, z;
};
inline Sheared shear(const TriangleRay& ray, Vec3f vertex) noexcept {
  const Vec3f a = vertex - ray.origin;
  const float z = a[ray.z_axis];
  return {a[ray.x_axis] - ray.shear_x * z, a[ray.y_axis] - ray.shear_y * z, z};
}
inline double edge(const Sheared& a, const Sheared& b) noexcept {
  return static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x;
}
}  // namespace detail

// True if the ray's line passes through the triangle (edges and vertices included; not through triangles seen
// exactly edge-on) within `range`, the ray's range in the triangle's own box: t is clamped to that range.
[[nodiscard]] inline bool intersect_triangle(const TriangleRay& ray, Vec3f v0, Vec3f v1, Vec3f v2, SlabRange box_range,
                                             TriangleHit& hit, Facing& facing) noexcept {
  const detail::Sheared a = detail::shear(ray, v0), b = detail::shear(ray, v1), c = detail::shear(ray, v2);
  const double weight0 = detail::edge(c, b), weight1 = detail::edge(a, c), weight2 = detail::edge(b, a);
  if ((weight0 < 0 || weight1 < 0 || weight2 < 0) && (weight0 > 0 || weight1 > 0 || weight2 > 0)) return false;
  const double sum = weight0 + weight1 + weight2;
  if (sum == 0 || !(box_range.near <= box_range.far)) return false;

  // t from the plane in double: the shear's rounding, magnified where the ray grazes the triangle, stays out of it.
  const Vec3d corner = to_double(v0) - to_double(ray.origin);
  const Vec3d normal = cross(to_double(v1) - to_double(v0), to_double(v2) - to_double(v0));
  double t = dot(normal, corner) / dot(normal, to_double(ray.direction));
  if (!std::isfinite(t)) {  // the normal vanishes or the plane holds the ray: the weighted mean of the corners' depths
    t = (weight0 * a.z + weight1 * b.z + weight2 * c.z) / (sum * ray.direction[ray.z_axis]);
  }
  const float narrowed = static_cast<float>(t);
  hit.t = narrowed < box_range.near ? box_range.near : narrowed > box_range.far ? box_range.far : narrowed;
  hit.u = static_cast<float>(weight1 / sum);
  hit.v = static_cast<float>(weight2 / sum);
  facing = (sum > 0) != ray.flips_winding ? Facing::kFront : Facing::kBack;
  return true;
}

}  // namespace perfect_bvh
