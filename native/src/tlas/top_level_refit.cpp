#include <algorithm>
#include <array>
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

bool is_instance(std::uint32_t child) noexcept { return child >= kInstanceChild; }

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
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[2 * axis][lane] = box.lower[axis], node.planes[2 * axis + 1][lane] = box.upper[axis];
    }
  }
}

// The lanes of nodes stay empty.
void place_instances(WideNode& node, std::span<const PrimRef> boxes, Float4 scale) noexcept {
  std::array<Box4, kWideWidth> placed;
  const Float4 zero(0.0f);  // -0 + 0 is +0
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    placed[lane] = Box4::empty();
    if (!is_instance(node.child[lane])) continue;
    const Box4 box = Box4::load(&boxes[node.child[lane] - kInstanceChild]);
    placed[lane] = {box.lower.xyz0() * scale + zero, box.upper.xyz0() * scale + zero};
  }
  write_planes(placed.data(), node);
}

template <class Body>
void for_nodes(WideBvh& wide, ThreadPool& pool, CancelToken& cancel, const Body& body) {
  for_chunks(pool, wide.nodes.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(wide.nodes[i]);
  });
}

Aabb bounds_of(std::span<const PrimRef> boxes, CancelToken& cancel) {
  Box4 all = Box4::empty();
  for_steps(boxes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) all.grow(Box4::load(&boxes[i]));
  });
  return to_aabb(all);
}

void refit_nodes(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  const Float4 scale(wide.scale);
  for_nodes(wide, pool, cancel, [&](WideNode& node) { place_instances(node, boxes, scale); });
  for_steps_back(wide.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = end; i-- > begin;) enclose_nodes_below(wide, wide.nodes[i]);
  });
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

// No node stands before its parent: the rows are gone through from the last to the first. Only the instances' own boxes
// have to be fetched from everywhere, and that is shared out.
void refit_boxes(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  const Aabb bounds = bounds_of(boxes, cancel);
  wide.scale = tree_scale(bounds);
  wide.extent = tree_extent(bounds, wide.scale);
  refit_nodes(wide, boxes, pool, cancel);
}

WideBvh refitted_at_step(const WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  WideBvh step = wide;
  refit_nodes(step, boxes, pool, cancel);
  for_nodes(step, pool, cancel, [](WideNode& node) { set_visit_order(node, child_count(node)); });
  return step;
}

bool serves_all_times(const WideBvh& wide, const WideBvh& step, ThreadPool& pool, CancelToken& cancel) {
  if (wide.nodes.empty()) return false;
  // In visits of a node that stands still, by the instructions that they take.
  constexpr double kMovingNode = 1.6, kInstance = 10.0;
  const auto cost = [&](const WideBvh& tree, double node) {
    const TopLevelCost visits = measure_cost(tree, pool, cancel);
    const double area = half_area(bounds_of_children(tree.nodes[tree.root]));
    return area * (node * visits.node_visits + kInstance * visits.instance_entries);
  };
  return cost(wide, 1.0) <= cost(step, kMovingNode);
}

void finish_refit(Bvh2& tree, WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  for_nodes(wide, pool, cancel, [](WideNode& node) { set_visit_order(node, child_count(node)); });
  refit_bvh2(tree, boxes, pool, cancel);
}

bool is_worth_keeping(const TopLevelCost& now, const TopLevelCost& built, std::size_t instance_count,
                      bool tries_clustering, std::optional<double> expected_rays) {
  if (!(built.node_visits > 0) || !(now.node_visits > 0)) return false;
  const double thinned = built.instance_entries > 0 ? now.instance_entries / built.instance_entries : 1.0;
  const double lost = expected_rays.value_or(kUnknownRays) * kVisitNanoseconds *
                      (now.node_visits - built.node_visits * std::min(1.0, thinned));
  const auto count = static_cast<double>(instance_count);
  const double clusters = tries_clustering ? std::min(count, static_cast<double>(kMostClusters)) : 0;
  return lost <= kBuildNanoseconds * count + kJoinNanoseconds * clusters;
}

std::string describe(const TopLevelCost& now, const TopLevelCost& built) {
  char text[160];
  std::snprintf(text, sizeof(text),
                "instances moved: %.4g nodes a ray, %.4g when it was built; %.4g instances, %.4g when it was built",
                now.node_visits, built.node_visits, now.instance_entries, built.instance_entries);
  return text;
}

}  // namespace perfect_bvh
