// Rays' hits on curves and points, and the positions of surface points at another time within the shutter.
#pragma once

#include <cstdint>

#include "math/aabb.h"
#include "math/curve_joint.h"
#include "math/vec3.h"
#include "mesh/round_mesh.h"
#include "tlas/instance.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Returns the hit point's position at time `to`. position: the hit in the world at time `from`. On a triangle, u and v
// stay the same; a point on a curve or a point moves with its axis.
[[nodiscard]] Vec3d moved_position(const Instance& instance, const Hit& hit, float from, float to,
                                   Vec3d position) noexcept;

// Round surface -------------------------------------------------------------------------------------------------------
// Computes the hits of curves and points, in world space: the point and the normal of the true surface. It starts from
// the ray, in double precision: a hit's t is a float, and from far away it is too coarse to locate the hit on a hair.
//
// Ribbons are flat, but their normals are round: those of a tube about the curve that is as wide as the curve where the
// ray hits it. Like the ribbon, the tube is round in the mesh's own space, and stretched with its instance. It turns
// with the curve from one segment to the next: its axis at a sphere is the mean of the two adjacent segments.

struct RoundPoint {
  Vec3d position;
  Vec3d normal;                // of length 1, outward; zero at a tip
  Vec3d along;                 // from the segment's first centre to its last; zero for points
  bool is_entry;               // the ray comes from outside; ribbons are always entered
  double ribbon_radius = 0.0;  // across the ray; 0 except for ribbons
};

// Returns where a ray from inside a curve leaves it, just outside. If segments overlap, it leaves where the last one
// ends, from the given segment on. time: the ray's.
[[nodiscard]] Vec3d leave_curve(const Instance& instance, std::uint32_t segment, Vec3d origin, Vec3d direction,
                                float time);

// Places one hit after another; keeps its data on an instance for the next hit.
class RoundPlacer {
 public:
  // The hit's primitive must be a segment or a point of the instance's mesh.
  [[nodiscard]] RoundPoint place(const Instance& instance, const Hit& hit, const Ray& ray) noexcept;

 private:
  [[nodiscard]] RoundPoint place_ribbon(const Instance& instance, const RoundList& list, std::uint32_t primitive,
                                        const RoundRay& local) const noexcept;

  const Instance* last_ = nullptr;
  Affine to_object_;
};

}  // namespace perfect_bvh
