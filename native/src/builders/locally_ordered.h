// Builds a binary tree over boxes along a Morton curve. The lower levels, which matter little, are the codes' radix
// tree (Lauterbach et al. 2009). From groups of a few dozen boxes upwards, clusters are joined: each finds its best
// partner among its nearest neighbours on the curve, pairs that chose each other are joined, and this repeats until one
// is left (Meister and Bittner 2018, "Parallel locally-ordered clustering for bounding volume hierarchy construction").
// In: boxes along a curve. Out: a binary tree over them, children before parents.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "math/vec3.h"

namespace perfect_bvh {

struct alignas(32) Cluster {
  Vec3f lower;
  std::uint32_t left;  // of two clusters: their numbers. Of a single box: the codes at its ends on the curve.
  Vec3f upper;
  std::uint32_t right;

  [[nodiscard]] Box4 box() const noexcept { return Box4::load(this); }
  [[nodiscard]] float half_area() const noexcept { return perfect_bvh::half_area(box().extent()); }
};

[[nodiscard]] inline Cluster make_cluster(const Box4& box, std::uint32_t left, std::uint32_t right) noexcept {
  Cluster cluster;
  box.lower.store(&cluster.lower);
  box.upper.store(&cluster.upper);
  cluster.left = left;
  cluster.right = right;
  return cluster;
}

// Boxes to be clustered, with room after them for the new clusters: see make_room_for_clusters().
struct BoxesAlongCurve {
  std::span<Cluster> clusters;
  std::uint32_t count = 0;  // number of boxes; they come first

  [[nodiscard]] Cluster& operator[](std::size_t box) const noexcept { return clusters[box]; }
};

// Clusters by number: first the boxes themselves, then joined pairs, in regions of which some rows are unused.
struct ClusterTree {
  struct Region {
    std::uint32_t begin, end;
  };

  std::span<Cluster> clusters;
  std::uint32_t box_count = 0;
  std::vector<Region> regions;  // each made by one thread, from boxes and from its own clusters
  Region top{};                 // made last, over all regions
  std::uint32_t root = 0;
};

// Takes the memory from `scratch`, which also reserves room for a plan for each cluster (wide/bottom_up.h).
// Throws EngineError if there are more boxes than clusters can be numbered, bad_alloc.
[[nodiscard]] BoxesAlongCurve make_room_for_clusters(std::size_t box_count, Scratch& scratch);

// Clusters at least one box. Coordinates must be such that areas do not overflow or underflow. The tree is the same for
// any number of threads, and never deeper than kMaxTreeDepth. It is in the memory of the boxes.
[[nodiscard]] ClusterTree cluster_along_curve(const BoxesAlongCurve& boxes, ThreadPool& pool, CancelToken& cancel);

// References in the order of their centres' Morton codes, and a tree over them in which each is a separate box.
class Curve {
 public:
  // scale_of(bounds) returns the power of two that the tree's coordinates are multiplied by.
  Curve(std::span<const PrimRef> prims, float (*scale_of)(const Box4& bounds), ThreadPool& pool, CancelToken& cancel);

  [[nodiscard]] const Box4& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const ClusterTree& tree() const noexcept { return tree_; }
  [[nodiscard]] const PrimRef& prim(std::size_t place) const noexcept {
    return prims_[static_cast<std::uint32_t>(sorted_[place])];
  }
  // Returns memory that is reserved for a plan for each cluster.
  [[nodiscard]] Scratch& scratch() noexcept { return scratch_; }

 private:
  std::span<const PrimRef> prims_;
  Scratch scratch_;
  std::span<const std::uint64_t> sorted_;  // a Morton code in the upper half, a reference's position in the lower
  Box4 bounds_;
  ClusterTree tree_;
};

}  // namespace perfect_bvh
