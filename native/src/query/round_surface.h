// Where rays meet curves and points, in world space: the point and the normal of the true surface. From the ray itself,
// in double precision: a hit's t is a float, and from far away says little of where on a hair it is.
#pragma once

#include "math/affine.h"
#include "math/vec3.h"
#include "tlas/instance.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct RoundPoint {
  Vec3d position;
  Vec3d normal;   // of length 1, outward; zero at a tip
  Vec3d along;    // from the segment's first centre to its last; zero for points
  bool is_entry;  // the ray comes from outside
};

// Of one hit after another: what is known of an instance is kept for the next hit.
class RoundPlacer {
 public:
  // The hit's primitive is a segment or a point of the instance's mesh.
  [[nodiscard]] RoundPoint place(const Instance& instance, const Hit& hit, const Ray& ray) noexcept;

 private:
  const Instance* last_ = nullptr;
  Affine to_object_;
};

}  // namespace perfect_bvh
