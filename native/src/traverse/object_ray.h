// A world ray as one instance sees it (lecture, "Rigid motion": the ray is transformed, not the geometry).
// The map is applied in double and narrowed once. The direction is not renormalised; it is only scaled by a power of
// two, which is exact, so that neither it nor its inverse leaves the range of float.
#pragma once

#include <cmath>

#include "math/affine.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct ObjectRay {
  Vec3f origin;
  Vec3f direction;
  double t_scale;  // a power of two: t in the object ray's terms = t in the world ray's * t_scale

  ObjectRay(const Affine& world_to_object, Vec3d world_origin, Vec3d world_direction) noexcept {
    origin = to_float(world_to_object.point(world_origin));
    const Vec3d mapped = world_to_object.vector(world_direction);
    const double largest = std::max({std::abs(mapped.x), std::abs(mapped.y), std::abs(mapped.z)});
    int exponent = 0;
    std::frexp(largest, &exponent);
    direction = {narrow(mapped.x, exponent), narrow(mapped.y, exponent), narrow(mapped.z, exponent)};
    t_scale = std::ldexp(1.0, exponent);
  }

  // Scaling by a power of two is exact unless t leaves the range of float; then it becomes infinite, or zero.
  [[nodiscard]] float to_object(float t) const noexcept { return static_cast<float>(t * t_scale); }
  [[nodiscard]] float to_world(float t) const noexcept { return static_cast<float>(t / t_scale); }

 private:
  static float narrow(double component, int exponent) noexcept {
    return static_cast<float>(std::ldexp(component, -exponent));
  }
};

}  // namespace perfect_bvh
