#include <algorithm>
#include <cstdio>
#include <vector>

#include "builders/refit.h"
#include "core/steps.h"
#include "tlas/top_level.h"
#include "wide/visit_order.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 512;  // nodes that a task works on

// Measured on one thread, with 1,000 to 100,000 instances: nanoseconds to build and collapse the tree over one, to join
// one cluster, and of a visit that is expected. Rays end at their first hit: on a grid of 100,000 instances they make a
// fifth of the visits that the heuristic expects, of 20 ns each.
constexpr double kBuild = 450.0, kJoin = 1400.0, kVisit = 4.0;
// The rays cast at a scene before it changes, where their number is unknown: the first rays of an image of 960 by 540.
constexpr double kExpectedRays = 5e5;

double half_area(const Aabb& box) noexcept {
  const Vec3d e = to_double(box.upper) - to_double(box.lower);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

bool is_instance(std::uint32_t child) noexcept { return child >= kInstanceChild; }

void set_lane(WideNode& node, std::uint32_t lane, const Vec3f& lower, const Vec3f& upper, float scale) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    // Adding +0 makes a zero positive, whichever the minimum of both kinds was.
    node.planes[2 * axis][lane] = lower[axis] * scale + 0.0f;
    node.planes[2 * axis + 1][lane] = upper[axis] * scale + 0.0f;
  }
}

// Of its taken lanes; the others' boxes are inverted, so that they add nothing.
Aabb bounds_of_children(const WideNode& node) noexcept {
  Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    float least = node.planes[2 * axis][0], most = node.planes[2 * axis + 1][0];
    for (std::uint32_t lane = 1; lane < kWideWidth; ++lane) {
      least = std::min(least, node.planes[2 * axis][lane]);
      most = std::max(most, node.planes[2 * axis + 1][lane]);
    }
    box.lower[axis] = least, box.upper[axis] = most;
  }
  return box;
}

std::uint32_t child_count(const WideNode& node) noexcept {
  std::uint32_t count = 0;
  while (count < kWideWidth && node.child[count] != kNoChild) ++count;
  return count;
}

void enclose_nodes_below(const WideBvh& wide, WideNode& node) noexcept {
  for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
    if (is_instance(node.child[lane])) continue;
    const Aabb box = bounds_of_children(wide.nodes[node.child[lane]]);
    set_lane(node, lane, box.lower, box.upper, 1.0f);
  }
}

// No node stands before its parent: the rows are gone through from the last to the first. Only the instances' own boxes
// have to be fetched from everywhere, and that is shared out.
void refit_wide(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  const auto for_nodes = [&](const auto& body) {
    for_chunks(pool, wide.nodes.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) body(wide.nodes[i]);
    });
  };
  for_nodes([&](WideNode& node) {
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (!is_instance(node.child[lane])) continue;
      const PrimRef& box = boxes[node.child[lane] - kInstanceChild];
      set_lane(node, lane, box.lower, box.upper, wide.scale);
    }
  });
  for_steps_back(wide.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) enclose_nodes_below(wide, wide.nodes[i]);
  });
  for_nodes([](WideNode& node) { set_visit_order(node, child_count(node)); });
}

TopLevelCost areas_of(std::span<const WideNode> nodes) noexcept {
  TopLevelCost areas;
  for (const WideNode& node : nodes) {
    for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
      (is_instance(node.child[lane]) ? areas.instance_entries : areas.node_visits) += half_area(child_box(node, lane));
    }
  }
  return areas;
}

}  // namespace

TopLevelCost measure_cost(const WideBvh& wide, ThreadPool& pool, CancelToken& cancel) {
  if (wide.nodes.empty()) return {};
  const double whole = half_area(bounds_of_children(wide.nodes[wide.root]));
  if (!(whole > 0)) return {};
  // By parts whose borders do not depend on the threads: sums of floating point numbers do on their order.
  std::vector<TopLevelCost> parts((wide.nodes.size() + kGrain - 1) / kGrain);
  for_chunks(pool, wide.nodes.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    parts[begin / kGrain] = areas_of(std::span(wide.nodes).subspan(begin, end - begin));
  });
  TopLevelCost cost{1, 0};
  for (const TopLevelCost& part : parts) {
    cost.node_visits += part.node_visits / whole, cost.instance_entries += part.instance_entries / whole;
  }
  return cost;
}

bool is_over(const Bvh2& tree, std::span<const PrimRef> boxes, CancelToken& cancel) {
  const auto is_filled = [](const PrimRef& ref) { return !ref.box().is_empty(); };
  std::size_t filled = 0;
  for_steps(boxes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) filled += is_filled(boxes[i]) ? 1 : 0;
  });
  if (filled != tree.prim_indices.size()) return false;
  // Where no row is empty, no box has to be looked up.
  bool all_there = true;
  for_steps(tree.prim_indices.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && all_there; ++i) {
      const std::uint32_t row = tree.prim_indices[i];
      all_there = row < boxes.size() && (filled == boxes.size() || is_filled(boxes[row]));
    }
  });
  return all_there;
}

void refit_top_level(Bvh2& tree, WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  refit_bvh2(tree, boxes, pool, cancel);
  wide.scale = tree_scale(tree.bounds());
  wide.extent = tree_extent(tree.bounds(), wide.scale);
  refit_wide(wide, boxes, pool, cancel);
}

bool is_worth_keeping(const TopLevelCost& now, const TopLevelCost& built, std::size_t instance_count,
                      std::optional<double> expected_rays) {
  if (!(built.node_visits > 0) || !(now.node_visits > 0)) return false;
  const double thinned = built.instance_entries > 0 ? now.instance_entries / built.instance_entries : 1.0;
  const double lost =
      expected_rays.value_or(kExpectedRays) * kVisit * (now.node_visits - built.node_visits * std::min(1.0, thinned));
  const auto count = static_cast<double>(instance_count);
  return lost <= kBuild * count + kJoin * std::min(count, static_cast<double>(kMostClusters));
}

std::string describe(const TopLevelCost& now, const TopLevelCost& built) {
  char text[160];
  std::snprintf(text, sizeof(text),
                "instances moved: %.4g nodes a ray, %.4g when it was built; %.4g instances, %.4g when it was built",
                now.node_visits, built.node_visits, now.instance_entries, built.instance_entries);
  return text;
}

}  // namespace perfect_bvh
