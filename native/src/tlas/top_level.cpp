#include "tlas/top_level.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "builders/agglomerative.h"
#include "builders/builder.h"
#include "builders/combine.h"
#include "core/steps.h"
#include "core/stopwatch.h"

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

// What two trees over the same leaves differ by in cost. In double: float sums would depend on the order.
double inner_area(const Bvh2& tree) {
  double sum = 0;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const Bvh2Node& node = tree.nodes[i];
    if (node.is_leaf() || i == 1) continue;
    const Vec3d e = to_double(node.upper) - to_double(node.lower);
    sum += e.x * e.y + e.y * e.z + e.z * e.x;
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

}  // namespace

TopLevel build_top_level(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel,
                         std::uint32_t most_clusters) {
  TopLevel top;
  if (prims.empty()) return top;
  Stopwatch watch;
  BuildConfig config;
  config.builder = BuilderKind::kBinned;
  config.max_leaf_size = 1;
  top.tree = build_bvh2(prims, config, pool, cancel);
  top.builder = builder_name(config.builder);
  top.build_milliseconds = watch.lap_milliseconds();
  if (cluster_top(top.tree, most_clusters, cancel)) top.builder = "agglomerative";
  top.clustering_milliseconds = watch.lap_milliseconds();
  return top;
}

}  // namespace perfect_bvh
