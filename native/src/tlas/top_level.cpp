#include "tlas/top_level.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>
#include <vector>

#include "builders/agglomerative.h"
#include "builders/builder.h"
#include "builders/combine.h"
#include "core/steps.h"
#include "core/stopwatch.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

// The upper part of a tree, cut off above subtrees of which the largest box is as small as may be.
struct Cut {
  AlignedVector<PrimRef> boxes;  // of the subtrees
  std::vector<TreePart> parts;   // the subtrees
  Bvh2 top;                      // what stands above them: leaf i refers to subtree i
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

// What two trees over the same leaves differ by in cost.
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

// Calls visit(ref, area) for each box whose area is no more than a limit.
template <class Visit>
void for_boxes_below(double limit, std::span<const PrimRef> prims, CancelToken& cancel, const Visit& visit) {
  for_steps(prims.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const PrimRef& ref : prims.subspan(begin, end - begin)) {
      const double area = half_area(ref.box());
      if (area <= limit) visit(ref, area);
    }
  });
}

// Around the boxes that are not much larger than most.
Box4 span_of_usual(std::span<const PrimRef> prims, CancelToken& cancel) {
  constexpr double kMuchLarger = 8.0;
  const auto mean_below = [&](double limit) {
    double sum = 0, count = 0;
    for_boxes_below(limit, prims, cancel, [&](const PrimRef&, double area) { sum += area, count += 1; });
    return count > 0 ? sum / count : limit;  // the mean of equal ones may be rounded to less than all of them
  };
  // Of those that are no larger than the mean, so that the large ones do not raise what they are compared with.
  const double usual = mean_below(mean_below(std::numeric_limits<double>::infinity()));
  Box4 box = Box4::empty();
  for_boxes_below(kMuchLarger * usual, prims, cancel, [&](const PrimRef& ref, double) { box.grow(Box4::load(&ref)); });
  return box;
}

// Planes through centroids cannot take a large instance away from the small ones that stand on a part of it: every node
// from the root down to its leaf is as large as it. Clustering wins at most what such nodes are larger than all the
// small ones together; a wide node holds seven of them. Measured with 20 to 10,000 boxes: where small ones stand
// everywhere, whatever their sizes, clustering hardly saves a visit: it is tried only for very many rays.
bool is_worth_clustering(const Bvh2& tree, std::span<const PrimRef> prims, std::uint32_t most_clusters, double rays,
                         CancelToken& cancel) {
  constexpr std::size_t kMany = 256;  // times as many instances as clusters: trying takes no longer than finding out
  constexpr double kLeastShare = 0.02;
  if (prims.size() > kMany * most_clusters) return true;
  const auto nodes = static_cast<double>(std::bit_width(prims.size())) / (kWideWidth - 1);
  const double whole = half_area(tree.bounds()), usual = half_area(to_aabb(span_of_usual(prims, cancel)));
  const double share = whole > usual ? std::max(kLeastShare, 1.0 - usual / whole) : kLeastShare;
  const auto clusters = static_cast<double>(std::min<std::size_t>(prims.size(), most_clusters));
  return rays * kVisitNanoseconds * nodes * share > kJoinNanoseconds * clusters;
}

// True, and the tree exchanged, if clustering its upper part makes it cheaper.
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

// Where rays are few for so many instances, they lose less on a tree along a curve than a better one takes to build.
Bvh2 build_tree(std::span<const PrimRef> prims, double rays, const char*& builder, ThreadPool& pool,
                CancelToken& cancel) {
  // For each instance. Measured with 1,000 to 100,000 boxes: to build in a half to a third of the time, for 5 percent
  // more visits (20 in rooms), breaks even at 5 to 25 rays an instance.
  constexpr double kFewRays = 5.0;
  BuildConfig config;
  config.builder = rays < kFewRays * static_cast<double>(prims.size()) ? BuilderKind::kFast : BuilderKind::kBinned;
  config.max_leaf_size = 1;
  builder = builder_name(config.builder);
  return build_bvh2(prims, config, pool, cancel);
}

}  // namespace

TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                         std::uint32_t most_clusters, std::optional<double> expected_rays) {
  TopLevel top;
  if (prims.empty()) return top;
  Stopwatch watch;
  const double rays = expected_rays.value_or(kUnknownRays);
  top.tree = build_tree(prims, rays, top.builder, pool, cancel);
  top.build_milliseconds = watch.lap_milliseconds();
  top.tried_clustering = is_worth_clustering(top.tree, prims, most_clusters, rays, cancel);
  if (top.tried_clustering && cluster_top(top.tree, most_clusters, cancel)) top.builder = "agglomerative";
  top.clustering_milliseconds = watch.lap_milliseconds();
  return top;
}

}  // namespace perfect_bvh
