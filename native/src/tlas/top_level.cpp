#include "tlas/top_level.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <limits>
#include <utility>
#include <vector>

#include "builders/agglomerative.h"
#include "builders/builder.h"
#include "builders/link_tree.h"
#include "core/cancel.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {
namespace {

// The upper part of a tree, cut above subtrees so that their largest box is as small as possible.
struct Cut {
  AlignedVector<PrimRef> boxes;  // of the subtrees
  std::vector<TreePart> parts;   // the subtrees
  Bvh2 top;                      // the nodes above them: leaf i refers to subtree i
};

class Cutter {
 public:
  explicit Cutter(const Bvh2& tree) : tree_(tree) {}

  Cut cut(std::uint32_t most_parts) {
    out_.top.nodes.assign(2, Bvh2Node{});
    offer(0, 0);
    while (!open_.empty() && open_.size() + closed_.size() < most_parts) {
      std::pop_heap(open_.begin(), open_.end());
      const Candidate widest = open_.back();
      open_.pop_back();
      const auto first = static_cast<std::uint32_t>(out_.top.nodes.size());
      const std::uint32_t child = tree_.nodes[widest.node].first;
      out_.top.nodes.resize(first + 2);
      out_.top.nodes[widest.place] = tree_.nodes[widest.node];
      out_.top.nodes[widest.place].first = first;
      offer(child, first);
      offer(child + 1, first + 1);
    }
    closed_.insert(closed_.end(), open_.begin(), open_.end());
    std::sort(closed_.begin(), closed_.end(), [](const auto& a, const auto& b) { return a.node < b.node; });
    for (const Candidate& part : closed_) close(part);
    return std::move(out_);
  }

 private:
  struct Candidate {
    float area;
    std::uint32_t node;   // of the tree
    std::uint32_t place;  // in the top
    bool operator<(const Candidate& other) const noexcept {
      return area != other.area ? area < other.area : node > other.node;
    }
  };

  void offer(std::uint32_t node, std::uint32_t place) {
    const Candidate candidate{tree_.nodes[node].box().half_area(), node, place};
    if (tree_.nodes[node].is_leaf()) return closed_.push_back(candidate);
    open_.push_back(candidate);
    std::push_heap(open_.begin(), open_.end());
  }

  void close(const Candidate& part) {
    const Bvh2Node& node = tree_.nodes[part.node];
    const auto number = static_cast<std::uint32_t>(out_.parts.size());
    out_.boxes.push_back({node.lower, number, node.upper, 0});
    out_.parts.push_back({&tree_, 0, part.node});
    out_.top.prim_indices.push_back(number);
    out_.top.nodes[part.place] = {node.lower, number, node.upper, 1};
  }

  const Bvh2& tree_;
  Cut out_;
  std::vector<Candidate> open_;  // a heap
  std::vector<Candidate> closed_;
};

// Returns the part of the cost in which trees over the same leaves differ.
double inner_area(const Bvh2& tree) {
  double sum = 0;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    if (!tree.nodes[i].is_leaf() && i != 1) sum += half_area(tree.nodes[i].box());
  }
  return sum;
}

std::uint32_t levels_below(const Bvh2& tree, std::uint32_t root, Steps& steps) {
  std::uint32_t deepest = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> stack{{root, 0}};
  for (; !stack.empty(); steps.step()) {
    const auto [node, depth] = stack.back();
    stack.pop_back();
    deepest = std::max(deepest, depth);
    if (tree.nodes[node].is_leaf()) continue;
    for (const std::uint32_t side : {0u, 1u}) stack.emplace_back(tree.nodes[node].first + side, depth + 1);
  }
  return deepest;
}

// The boxes around all boxes, and around those that are not much larger than most.
struct Spans {
  Box4 all = Box4::empty(), usual = Box4::empty();
};

Spans measure_spans(std::span<const PrimRef> prims, CancelToken& cancel) {
  constexpr double kMuchLarger = 8.0;
  constexpr std::size_t kSample = 4096;  // boxes, evenly spaced, from which the usual area is known well enough
  const auto mean_below = [&](double limit) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < prims.size(); i += prims.size() / kSample + 1) {
      const double area = half_area(prims[i].box());
      if (area <= limit) sum += area, count += 1;
    }
    return count > 0 ? sum / count : limit;  // the mean of equal areas may be rounded to less than all of them
  };
  // Averages only boxes up to the mean, so that large ones do not raise the reference value.
  const double usual = mean_below(mean_below(std::numeric_limits<double>::infinity()));
  Spans spans;
  for_steps(prims.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const PrimRef& ref : prims.subspan(begin, end - begin)) {
      spans.all.grow(Box4::load(&ref));
      if (half_area(ref.box()) <= kMuchLarger * usual) spans.usual.grow(Box4::load(&ref));
    }
  });
  return spans;
}

// Planes through centroids cannot separate a large instance from the small ones that are on a part of it: every node
// from the root down to its leaf is as large as the instance. Clustering gains at most the difference in area between
// such nodes and all small ones together; a wide node holds seven of them. Measured with 20 to 10,000 boxes: if small
// instances are everywhere, of any sizes, clustering saves almost no visits. It is then tried only for very many rays.
bool is_worth_clustering(std::span<const PrimRef> prims, std::uint32_t most_clusters, double rays,
                         CancelToken& cancel) {
  constexpr double kLeastShare = 0.02;
  const auto nodes = static_cast<double>(std::bit_width(prims.size())) / (kWideWidth - 1);
  const Spans spans = measure_spans(prims, cancel);
  const double whole = half_area(to_aabb(spans.all)), usual = half_area(to_aabb(spans.usual));
  const double share = whole > usual ? std::max(kLeastShare, 1.0 - usual / whole) : kLeastShare;
  const auto clusters = static_cast<double>(std::min<std::size_t>(prims.size(), most_clusters));
  return rays * kVisitNanoseconds * nodes * share > kJoinNanoseconds * clusters;
}

// Clusters the upper part of the tree. Returns true, with the tree replaced, if that makes it cheaper.
bool cluster_top(Bvh2& tree, std::uint32_t most_clusters, CancelToken& cancel) {
  const Cut cut = Cutter(tree).cut(most_clusters);
  const Bvh2 clustered = build_agglomerative(cut.top, 0, cut.boxes, cancel);
  if (!(inner_area(clustered) < inner_area(cut.top))) return false;
  std::uint32_t depth = 0;
  Steps steps(cancel);
  for (const TreePart& part : cut.parts) depth = std::max(depth, levels_below(tree, part.root, steps));
  if (clustered.depth + depth > kMaxTreeDepth) return false;
  tree = graft(clustered, cut.parts, cancel);
  return true;
}

}  // namespace

TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                         std::uint32_t most_clusters, std::optional<double> expected_rays) {
  // Rays per instance. If there are fewer, they lose less on a tree along a curve than a better one takes to build.
  // Measured with 1,000 to 100,000 boxes: building in half the time, for 2 to 5 percent more visits on a grid (20 in
  // rooms, fewer in a heap), breaks even at 14 to 25 rays per instance (3 in rooms).
  constexpr double kFewRays = 8.0;
  TopLevel top;
  if (prims.empty()) return top;
  Stopwatch watch;
  const double rays = expected_rays.value_or(kUnknownRays);
  top.tried_clustering = is_worth_clustering(prims, most_clusters, rays, cancel);
  top.clustering_milliseconds = watch.lap_milliseconds();
  BuildConfig config;
  config.builder = rays < kFewRays * static_cast<double>(prims.size()) ? BuilderKind::kFast : BuilderKind::kBinned;
  config.max_leaf_size = 1;
  top.builder = builder_name(config.builder);
  if (config.builder == BuilderKind::kFast && !top.tried_clustering) {
    top.wide = build_fast_top_level(prims, pool, cancel);
  } else {
    top.tree = build_bvh2(prims, config, pool, cancel);
  }
  top.build_milliseconds = watch.lap_milliseconds();
  if (top.tried_clustering && cluster_top(top.tree, most_clusters, cancel)) top.builder = "agglomerative";
  top.clustering_milliseconds += watch.lap_milliseconds();
  return top;
}

// Top level refit -----------------------------------------------------------------------------------------------------

namespace {

constexpr std::size_t kGrain = 512;  // nodes processed by one task

bool is_instance(std::uint32_t child) noexcept { return child >= kInstanceChild; }

// Returns the bounds of the used lanes; the other boxes are inverted, so they add nothing.
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

void enclose_nodes_below(const WideBvh& wide, WideNode& node) noexcept {
  for (std::uint32_t lane = 0; lane < kWideWidth && node.child[lane] != kNoChild; ++lane) {
    if (is_instance(node.child[lane])) continue;
    const Aabb box = bounds_of_children(wide.nodes[node.child[lane]]);
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[2 * axis][lane] = box.lower[axis], node.planes[2 * axis + 1][lane] = box.upper[axis];
    }
  }
}

// The lanes of child nodes stay empty.
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
  // Summed in chunks that do not depend on the threads, because floating-point sums depend on their order.
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

bool is_over(const WideBvh& tree, std::span<const PrimRef> boxes, CancelToken& cancel) {
  const auto is_filled = [](const PrimRef& ref) { return !ref.box().is_empty(); };
  std::size_t filled = 0;
  for_steps(boxes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) filled += is_filled(boxes[i]) ? 1 : 0;
  });
  std::size_t found = 0;
  // If no row is empty, no box has to be read.
  const auto count = [&](std::uint32_t child) {
    const std::size_t row = child - kInstanceChild;
    found += is_instance(child) && row < boxes.size() && (filled == boxes.size() || is_filled(boxes[row])) ? 1 : 0;
    return is_instance(child) ? 1 : 0;
  };
  std::size_t held = count(tree.root);
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (const std::uint32_t child : tree.nodes[i].child) held += count(child);
    }
  });
  return found == filled && held == filled;
}

// No node is before its parent, so the rows are visited from the last to the first. Only reading the instances' boxes,
// which are scattered in memory, is divided among threads.
void refit_boxes(WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  const Aabb bounds = bounds_of(boxes, cancel);
  wide.scale = tree_scale(bounds);
  wide.extent = tree_extent(bounds, wide.scale);
  refit_nodes(wide, boxes, pool, cancel);
}

WideBvh refitted_at_step(const WideBvh& wide, std::span<const PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  WideBvh step = wide;
  refit_nodes(step, boxes, pool, cancel);
  finish_refit(step, pool, cancel);
  return step;
}

bool serves_all_times(const WideBvh& wide, const WideBvh& step, ThreadPool& pool, CancelToken& cancel) {
  if (wide.nodes.empty()) return false;
  // In visits of a node that does not move, by instruction count.
  constexpr double kMovingNode = 1.6, kInstance = 10.0;
  const auto cost = [&](const WideBvh& tree, double node) {
    const TopLevelCost visits = measure_cost(tree, pool, cancel);
    const double area = half_area(bounds_of_children(tree.nodes[tree.root]));
    return area * (node * visits.node_visits + kInstance * visits.instance_entries);
  };
  return cost(wide, 1.0) <= cost(step, kMovingNode);
}

void finish_refit(WideBvh& wide, ThreadPool& pool, CancelToken& cancel) {
  for_nodes(wide, pool, cancel, [](WideNode& node) { set_visit_order(node, child_count(node)); });
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
