// World boxes of an instance that moves within the shutter, and of its top level's leaves.
//
// The top level is known at steps, too, between which its boxes move in straight lines. Points of a mesh's box go in
// straight lines in the mesh's frame, and along curves in the world if the instance turns: p = T + R S c with T, S and
// c linear, |p''| <= w^2 |S||c| + 2 w (|S'||c| + |S||c'|) + 2 |S'||c'| at w radians per unit of time. Within h of time
// a point is never further from its chord than h^2 |p''| / 8. Where a step of the instance falls between two of the top
// level's, the path has a corner: boxes are taken there, and both ends widened until all between is inside.
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

// More steps make tighter boxes, and each is a top level of its own.
inline constexpr std::uint32_t kMostTopSteps = 16;

class MovingBounds {
 public:
  // The mesh has primitives.
  explicit MovingBounds(const Instance& instance);

  // How many intervals of the top level would hold its boxes to about a tenth of their size.
  [[nodiscard]] std::uint32_t wanted_intervals() const;
  // Boxes at the ends of as many equal intervals from time 0 to 1 as there are boxes, less one: between two of them, as
  // interpolated, is all of the instance.
  void fill(std::span<Aabb> boxes) const;

 private:
  struct Box {
    Vec3d lower, upper;
  };
  // With the margin of blas/world_box.h.
  [[nodiscard]] Box at(double time) const;
  [[nodiscard]] Aabb mesh_box_at(double time) const;
  // Of |p''| for times within these limits.
  [[nodiscard]] double bend(double begin, double end) const;
  void widen(double begin, double end, Box& first, Box& last) const;

  const Instance& instance_;
  const SupportTable* support_ = nullptr;  // of a mesh that keeps its shape: closer than its box where it is turned
  std::vector<double> corners_;            // times from 0 to 1 at which something has a step
  double farthest_ = 0;                    // |c|
  double fastest_ = 0;                     // |c'|
};

// Motions -------------------------------------------------------------------------------------------------------------
// What moves within the shutter, in a snapshot that is being put together: the kernels' views of it, and the boxes of
// its instances at the steps of the top level.

// By step, then by the instance's row.
using StepBoxes = std::vector<AlignedVector<PrimRef>>;

// The instances are placed, with their turns and their meshes; `boxes` are their world boxes at the shutter's opening,
// and become those of all their ways. Fills in the instances' and views' motions, and widens the snapshot's bounds.
// Empty, and nothing done, if nothing moves. Throws Cancelled, bad_alloc.
[[nodiscard]] StepBoxes add_motions(Snapshot& snapshot, std::span<PrimRef> boxes, ThreadPool& pool,
                                    CancelToken& cancel);

}  // namespace perfect_bvh
