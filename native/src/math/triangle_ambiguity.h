// A ray against a triangle in double precision, with explicit rounding bounds: the judge of the float kernels.
// In: a triangle's corners and a ray in world space, and by how much rounding may have moved the ray (`margin`, world
// units). Out: surely hit (inside all three edges by more than the margin), surely missed, or neither; t, and by how
// much a right answer may differ from it.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/vec3.h"

namespace perfect_bvh {

inline constexpr double kFloatUlp = 0x1p-24;
// Of the margin: what double precision loses where float loses that.
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
  Vec3d normal;         // by the winding, as long as twice the area
  double squared_area;  // of it
  Vec3d centre;
  double radius;  // of a ball about the centre that holds the triangle

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
  bool has_t = false;  // seen almost edge-on a triangle has no t to speak of
  bool is_front = false;
  double t = 0, bound = 0;
};

// Whether the line of the ray passes the ball by more than the margin. Far cheaper than judge_triangle().
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
  const double facing = dot(ray.direction, triangle.normal);
  // The cosine of ray and normal is below 1e-6: the signs of the edges' distances would be noise.
  if (!(facing * facing > 1e-12 * ray.squared_length * triangle.squared_area)) return result;
  const Vec3d from_origin[3] = {triangle.corners[0] - ray.origin, triangle.corners[1] - ray.origin,
                                triangle.corners[2] - ray.origin};
  result.t = dot(triangle.normal, from_origin[0]) / facing;
  const double rounding = 2.0 * kFloatUlp * std::abs(result.t);
  const double moved = margin * std::sqrt(triangle.squared_area) / std::abs(facing);
  result.bound = rounding + moved;
  if (!std::isfinite(result.t) || !std::isfinite(result.bound)) return result;
  result.has_t = true;
  result.is_front = facing < 0;
  int inside = 0;
  for (int i = 0; i < 3; ++i) {
    // The side from its corners: as a difference of two long vectors that of a tiny triangle would be lost.
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
