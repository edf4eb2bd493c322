// End-point overlap: what a ray pays for nodes whose boxes hold a surface that is not in them (Aila, Karras and Laine
// 2013, "On quality metrics of bounding volume hierarchies", section 4). A ray ends on a surface; the nodes around that
// point are visited whether or not the surface is theirs. SAH does not see it, and trees of equal SAH differ by it.
// In: a tree and the triangles it was built over. Out: the expected cost of those visits, comparable with the SAH.

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "builders/quality.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 512;

// A triangle cut by up to six planes: nine corners at most.
class Polygon {
 public:
  Polygon(Vec3d a, Vec3d b, Vec3d c) noexcept : corners_{a, b, c}, count_(3) {}

  // What lies within the box; Sutherland and Hodgman 1974.
  void clip(const Aabb& box) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      clip(axis, static_cast<double>(box.lower[axis]), 1.0);
      clip(axis, static_cast<double>(box.upper[axis]), -1.0);
    }
  }
  [[nodiscard]] double area() const noexcept {
    Vec3d sum{0, 0, 0};
    for (std::size_t i = 2; i < count_; ++i)
      sum = sum + cross(corners_[i - 1] - corners_[0], corners_[i] - corners_[0]);
    return 0.5 * length(sum);
  }

 private:
  // Keeps what has sign * (coordinate - border) >= 0.
  void clip(int axis, double border, double sign) noexcept {
    std::array<Vec3d, 9> kept;
    std::size_t kept_count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec3d from = corners_[i], to = corners_[(i + 1) % count_];
      const double from_distance = sign * (from[axis] - border), to_distance = sign * (to[axis] - border);
      if (from_distance >= 0) kept[kept_count++] = from;
      if ((from_distance > 0 && to_distance < 0) || (from_distance < 0 && to_distance > 0)) {
        Vec3d cut = from + (to - from) * (from_distance / (from_distance - to_distance));
        cut[axis] = border;
        kept[kept_count++] = cut;
      }
    }
    std::copy_n(kept.begin(), kept_count, corners_.begin());
    count_ = kept_count;
  }

  std::array<Vec3d, 9> corners_;
  std::size_t count_;
};

struct Topology {
  std::vector<std::uint32_t> parents;      // of each node
  std::vector<std::uint32_t> leaf_starts;  // rows of `leaves` for each primitive; one more at the end
  std::vector<std::uint32_t> leaves;       // that refer to a primitive

  Topology(const Bvh2& tree, std::size_t primitive_count)
      : parents(tree.nodes.size(), 0), leaf_starts(primitive_count + 1, 0), leaves(tree.prim_indices.size()) {
    for (const std::uint32_t prim : tree.prim_indices) ++leaf_starts[prim + 1];
    for (std::size_t i = 1; i < leaf_starts.size(); ++i) leaf_starts[i] += leaf_starts[i - 1];
    auto next = leaf_starts;
    for (std::uint32_t i = 0; i < tree.nodes.size(); ++i) {
      const Bvh2Node& node = tree.nodes[i];
      for (std::uint32_t row = 0; row < node.count; ++row) leaves[next[tree.prim_indices[node.first + row]]++] = i;
      if (!node.is_leaf() && i != 1) parents[node.first] = parents[node.first + 1] = i;
    }
  }
};

// Prices one triangle after another; knows by stamps which nodes the present one is below.
class Pricer {
 public:
  Pricer(const Bvh2& tree, const Topology& topology, double traversal_cost, double intersection_cost)
      : tree_(tree),
        topology_(topology),
        traversal_cost_(traversal_cost),
        intersection_cost_(intersection_cost),
        stamps_(tree.nodes.size(), 0) {}

  [[nodiscard]] double price(std::uint32_t prim, const Polygon& triangle) {
    stamp_ancestors(prim);
    double cost = 0;
    stack_.clear();
    stack_.emplace_back(0, triangle);
    while (!stack_.empty()) {
      auto [index, polygon] = stack_.back();
      stack_.pop_back();
      const Bvh2Node& node = tree_.nodes[index];
      polygon.clip(node.box());
      const double area = polygon.area();
      if (!(area > 0)) continue;
      const bool is_own = stamps_[index] == prim + 1;
      if (!is_own) cost += area * (node.is_leaf() ? intersection_cost_ * node.count : traversal_cost_);
      if (node.is_leaf()) continue;
      stack_.emplace_back(node.first, polygon);
      stack_.emplace_back(node.first + 1, polygon);
    }
    return cost;
  }

 private:
  void stamp_ancestors(std::uint32_t prim) {
    for (std::uint32_t row = topology_.leaf_starts[prim]; row < topology_.leaf_starts[prim + 1]; ++row) {
      std::uint32_t node = topology_.leaves[row];
      for (; stamps_[node] != prim + 1; node = topology_.parents[node]) stamps_[node] = prim + 1;
    }
  }

  const Bvh2& tree_;
  const Topology& topology_;
  const double traversal_cost_, intersection_cost_;
  std::vector<std::uint32_t> stamps_;
  std::vector<std::pair<std::uint32_t, Polygon>> stack_;
};

}  // namespace

double measure_epo(const Bvh2& tree, std::span<const Vec3f> positions, std::span<const Vec3<std::uint32_t>> triangles,
                   ThreadPool& pool, CancelToken& cancel, float traversal_cost, float intersection_cost) {
  if (tree.empty()) return 0;
  const Topology topology(tree, triangles.size());
  struct Sums {
    double cost = 0, area = 0;
  };
  std::vector<Sums> chunks((triangles.size() + kGrain - 1) / kGrain);
  // A few chunks a task: each pricer has a stamp for every node.
  const std::size_t chunks_a_task = chunks.size() / static_cast<std::size_t>(4 * pool.thread_count()) + 1;
  parallel_for(pool, chunks.size(), chunks_a_task, [&](std::size_t begin, std::size_t end) {
    Pricer pricer(tree, topology, static_cast<double>(traversal_cost), static_cast<double>(intersection_cost));
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      cancel.checkpoint();
      const std::size_t first = chunk * kGrain, last = std::min(triangles.size(), first + kGrain);
      cancel.advance(last - first);
      for (std::size_t i = first; i < last; ++i) {
        const Vec3<std::uint32_t> t = triangles[i];
        const Polygon polygon(to_double(positions[t.x]), to_double(positions[t.y]), to_double(positions[t.z]));
        chunks[chunk].area += polygon.area();
        chunks[chunk].cost += pricer.price(static_cast<std::uint32_t>(i), polygon);
      }
    }
  });
  Sums all;
  for (const Sums& chunk : chunks) all.cost += chunk.cost, all.area += chunk.area;
  return all.area > 0 ? all.cost / all.area : 0;
}

}  // namespace perfect_bvh
