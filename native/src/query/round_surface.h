// Curves and points as rays meet them, and where a place on a surface is at another time within the shutter.
#pragma once

#include <cstdint>

#include "math/aabb.h"
#include "math/curve_joint.h"
#include "math/vec3.h"
#include "mesh/round_mesh.h"
#include "tlas/instance.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// position: where the hit is in the world at time `from`. Of a triangle the place of the same u and v at time `to`;
// what is hit of a curve or a point goes with its axis.
[[nodiscard]] Vec3d moved_position(const Instance& instance, const Hit& hit, float from, float to,
                                   Vec3d position) noexcept;

// Round surface -------------------------------------------------------------------------------------------------------
// Where rays meet curves and points, in world space: the point and the normal of the true surface. From the ray itself,
// in double precision: a hit's t is a float, and from far away says little of where on a hair it is.
//
// Ribbons are flat, and their normals are round: those of a tube about the curve that is as wide where the ray meets
// it. Like the ribbon, the tube is round in the mesh's own space, and stretched with its instance; it turns with the
// curve from one segment to the next, as its axis between two balls is between the means of the segments beside each.
// Rays go on from where the one that came enters or leaves the tube: from there they meet the ribbon again only if they
// go back into it.

struct RoundPoint {
  Vec3d position;
  Vec3d normal;          // of length 1, outward; zero at a tip
  Vec3d along;           // from the segment's first centre to its last; zero for points
  bool is_entry;         // the ray comes from outside; ribbons are always entered
  Vec3d before, behind;  // where rays leave from, on this side and on the other: `position`, but of ribbons
};

// Where a ray from inside of a curve leaves it, just outside of that. A curve of segments that overlap is left where
// the last of them is, from the given one on; ribbons where the tubes of their normals are. time: of the ray.
[[nodiscard]] Vec3d leave_curve(const Instance& instance, std::uint32_t segment, Vec3d origin, Vec3d direction,
                                float time);

// Of one hit after another: what is known of an instance is kept for the next hit.
class RoundPlacer {
 public:
  // The hit's primitive is a segment or a point of the instance's mesh.
  [[nodiscard]] RoundPoint place(const Instance& instance, const Hit& hit, const Ray& ray) noexcept;

 private:
  [[nodiscard]] RoundPoint place_ribbon(const Instance& instance, const RoundList& list, std::uint32_t primitive,
                                        const RoundRay& local) const noexcept;

  const Instance* last_ = nullptr;
  Affine to_object_;
};

}  // namespace perfect_bvh
