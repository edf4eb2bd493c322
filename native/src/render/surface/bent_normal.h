// The normal that facets are spread around. A smooth normal may send a mirror's image below the triangle, where there
// is nothing to be seen: it is turned towards the triangle's own until the image lies just above, as Cycles has it.
// In: both normals and the way to the viewer, unit length, the triangle's on the viewer's side. Out: a unit normal.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/elementary.h"
#include "math/vec3.h"

namespace perfect_bvh {

// In the plane of both normals the view is r (sin p, cos p), across the triangle's normal and along it. Mirrored at a
// normal of the angle a from the triangle's it has the height r cos(2 a - p), which is `least` where a is half of p + q
// and r cos q is `least`: that normal lies half-way between the triangle's and the direction at p + q.
[[nodiscard]] inline Vec3f bent_normal(Vec3f smooth, Vec3f geometric, Vec3f view) noexcept {
  const float height = dot(view, geometric), along = dot(smooth, geometric);
  const float least = std::min(0.9f * height, 0.01f);
  if (2.0f * dot(smooth, view) * along - height >= least) return smooth;
  const Vec3f across = normalized(smooth - geometric * along);
  const float side = dot(view, across), radius = std::sqrt(side * side + height * height);
  if (!(radius > 0.0f)) return smooth;
  const float sin_p = side / radius, cos_p = height / radius;
  const float cos_q = std::clamp(least / radius, -1.0f, 1.0f), sin_q = std::sqrt(1.0f - cos_q * cos_q);
  const float sine = sin_p * cos_q + cos_p * sin_q, cosine = cos_p * cos_q - sin_p * sin_q;
  return normalized(across * sine + geometric * (1.0f + cosine));
}

}  // namespace perfect_bvh
