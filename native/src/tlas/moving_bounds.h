// World boxes of an instance that moves within the shutter, and of its top level's leaves.
//
// The top level has steps too, and its boxes move in straight lines between them. Points of a mesh's box move in
// straight lines in the mesh's frame, and along curves in the world if the instance turns: p = T + R S c with T, S and
// c linear, |p''| <= w^2 |S||c| + 2 w (|S'||c| + |S||c'|) + 2 |S'||c'| at w radians per unit of time. Within h of time
// a point is never farther from its chord than h^2 |p''| / 8. The path has a corner where a step of the instance falls
// between two steps of the top level. Boxes are computed there too, and both ends are widened until everything between
// is inside.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/aabb.h"
#include "tlas/assemble.h"
#include "tlas/instance.h"

namespace perfect_bvh {

// More steps make tighter boxes, but each is a separate top level.
inline constexpr std::uint32_t kMostTopSteps = 16;

class MovingBounds {
 public:
  // The instance's mesh must have primitives.
  explicit MovingBounds(const Instance& instance);

  // Returns the number of top-level intervals that would keep its boxes to about a tenth of their size.
  [[nodiscard]] std::uint32_t wanted_intervals() const;
  // Writes boxes at the ends of equal intervals from time 0 to 1, one interval fewer than boxes. The interpolation of
  // two consecutive boxes contains the whole instance.
  void fill(std::span<Aabb> boxes) const;

 private:
  struct Box {
    Vec3d lower, upper;
  };
  // Returns the box with the margin of blas/world_box.h.
  [[nodiscard]] Box at(double time) const;
  [[nodiscard]] Aabb mesh_box_at(double time) const;
  // Returns a bound of |p''| for times within these limits.
  [[nodiscard]] double bend(double begin, double end) const;
  void widen(double begin, double end, Box& first, Box& last) const;

  const Instance& instance_;
  const SupportTable* support_ = nullptr;  // of a mesh that does not deform: tighter than its box if it is turned
  std::vector<double> corners_;            // times from 0 to 1 of the steps of the instance or its mesh
  double farthest_ = 0;                    // |c|
  double fastest_ = 0;                     // |c'|
};

// Motions -------------------------------------------------------------------------------------------------------------
// The motion within the shutter, for a snapshot that is being assembled: the kernels' views of it, and the boxes of its
// instances at the steps of the top level.

// By step, then by the instance's row.
using StepBoxes = std::vector<AlignedVector<PrimRef>>;

// Adds the motions to a snapshot whose instances are placed, with their turns and their meshes. `boxes` are their world
// boxes at the shutter's opening, and are extended to their whole motion. Fills in the motions of instances and views,
// and widens the snapshot's bounds. Returns nothing, and does nothing, if nothing moves. Throws Cancelled, bad_alloc.
[[nodiscard]] StepBoxes add_motions(Snapshot& snapshot, std::span<PrimRef> boxes, ThreadPool& pool,
                                    CancelToken& cancel);

}  // namespace perfect_bvh
