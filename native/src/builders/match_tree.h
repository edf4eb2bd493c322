// Finds the best match of a cluster among all others: the one with which its joint box has the least surface.
// In: boxes, and any tree over them with one box per leaf, which is updated while clusters are joined. Out: matches.
// Source: Walter, Bala, Kulkarni and Pingali 2008, "Fast Agglomerative Clustering for Rendering", section 4.
//
// A node stores the core that every joint box with one of its clusters must reach: the greatest of their lower corners
// and the least of their upper corners (often lower > upper). The core, grown by a query's box, is a lower bound of the
// joint surface. A leaf's core is its cluster's box, so the bound is exact there.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "builders/bvh2.h"
#include "math/float4.h"

namespace perfect_bvh {

// The cost of joining two clusters; smaller is better. No two pairs are equal, and joining clusters makes no other pair
// better. So following best matches ends in a pair, and the order of joining does not change the result.
struct MatchCost {
  float area;            // half the surface of the joint box
  float side;            // the sum of its sides, to compare flat boxes
  std::uint32_t count;   // boxes in both: among equals, small clusters are joined first, which keeps trees shallow
  std::uint32_t low_id;  // the lesser and the greater of the clusters' ids
  std::uint32_t high_id;

  [[nodiscard]] bool is_better_tie(const MatchCost& other) const noexcept {
    if (side != other.side) return side < other.side;
    if (count != other.count) return count < other.count;
    if (low_id != other.low_id) return low_id < other.low_id;
    return high_id < other.high_id;
  }
  [[nodiscard]] bool operator<(const MatchCost& other) const noexcept {
    return area < other.area || (area == other.area && is_better_tie(other));
  }
};

class MatchTree {
 public:
  // Copies the part of `guide` below `node`; its leaves refer to one row of `prims` each. Clusters are numbered like
  // rows of the part (see row_of), then in the order of joining.
  MatchTree(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims);

  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  [[nodiscard]] std::uint32_t leaf_count() const noexcept { return leaf_count_; }
  // Returns the row of `prims` for a cluster < leaf_count().
  [[nodiscard]] std::uint32_t row_of(std::uint32_t cluster) const noexcept { return clusters_[cluster].id; }
  // Returns the best match of a cluster among all others, of which there must be one. `hint`: another cluster, or
  // kNone.
  [[nodiscard]] std::uint32_t find_best(std::uint32_t cluster, std::uint32_t hint) noexcept;
  // Replaces two clusters by their union. Returns its number.
  std::uint32_t join(std::uint32_t a, std::uint32_t b);

 private:
  struct Cluster {
    std::uint32_t id;  // the least row in it
    std::uint32_t count;
    std::uint32_t node;  // its node
  };
  struct Node {
    Box4 core;
    std::uint32_t first = 0;     // interior: the left child's index (even); the right one follows
    std::uint32_t cluster = 0;   // leaf; kNone in an interior node
    std::uint32_t least_id = 0;  // of the clusters below
    std::uint32_t least_count = 0;
  };

  void copy_guide(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims, double scale);
  void set_leaf(std::uint32_t node, std::uint32_t cluster, const Box4& box) noexcept;
  // Returns whether anything changed.
  bool update(std::uint32_t node) noexcept;
  void update_upwards(std::uint32_t node) noexcept;
  void remove(std::uint32_t node) noexcept;
  [[nodiscard]] std::uint32_t& parent_of(std::uint32_t node) noexcept { return parents_[node / 2]; }

  struct Query {
    Box4 box;
    std::uint32_t id, count;
    std::uint32_t best;
    MatchCost best_cost;
  };
  [[nodiscard]] static float bound_of(const Query& query, const Node& node) noexcept;
  [[nodiscard]] static MatchCost full_bound_of(const Query& query, const Node& node, float area) noexcept;
  [[nodiscard]] static bool may_hold_better(const Query& query, const Node& node, float area) noexcept;
  void search(Query& query, std::uint32_t node, float area) noexcept;
  static void take(Query& query, const Node& leaf, float area) noexcept;

  std::vector<Cluster> clusters_;
  AlignedVector<Node> nodes_;
  std::vector<std::uint32_t> parents_;  // of pairs of nodes
  struct Pending {
    std::uint32_t node;
    float area;
  };
  std::vector<Pending> stack_;
  std::uint32_t leaf_count_ = 0;
};

}  // namespace perfect_bvh
