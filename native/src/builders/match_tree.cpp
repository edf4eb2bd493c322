#include "builders/match_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace perfect_bvh {
namespace {

// Returns a power of two that scales the boxes so that no surface overflows and few underflow.
double scale_for(const Aabb& bounds) {
  const Vec3d extent = to_double(bounds.upper) - to_double(bounds.lower);
  const double longest = std::max({extent.x, extent.y, extent.z});
  constexpr int kLongestExponent = 60;
  return longest > 0 ? std::ldexp(1.0, kLongestExponent - std::ilogb(longest)) : 1.0;
}

Float4 scaled(Vec3f corner, double scale) {
  const Vec3d c = to_double(corner) * scale;
  return {static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z), 0.0f};
}

float sum_of_sides(Float4 extent) { return (extent + extent.yzxw() + extent.zxyw()).x(); }

Box4 joint(Box4 a, const Box4& b) {
  a.grow(b);
  return a;
}

}  // namespace

MatchTree::MatchTree(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims) {
  copy_guide(guide, node, prims, scale_for(guide.nodes[node].box()));
  stack_.reserve(2 * kMaxTreeDepth);
}

void MatchTree::copy_guide(const Bvh2& guide, std::uint32_t node, std::span<const PrimRef> prims, double scale) {
  // Node 0 is the copy's root, node 1 is unused: pairs begin at even indices, as in the guide.
  std::vector<std::uint32_t> sources{node, node};
  nodes_.resize(2);
  parents_.push_back(kNone);
  for (std::uint32_t to = 0; to < sources.size(); ++to) {
    if (to == 1) continue;
    const Bvh2Node& from = guide.nodes[sources[to]];
    if (from.is_leaf()) {
      const std::uint32_t row = guide.prim_indices[from.first];
      clusters_.push_back({row, 1, to});
      const Box4 box{scaled(prims[row].lower, scale), scaled(prims[row].upper, scale)};
      set_leaf(to, leaf_count_++, box);
      continue;
    }
    nodes_[to].cluster = kNone;
    nodes_[to].first = static_cast<std::uint32_t>(sources.size());
    sources.insert(sources.end(), {from.first, from.first + 1});
    nodes_.resize(sources.size());
    parents_.push_back(to);
  }
  clusters_.reserve(2 * std::size_t{leaf_count_});
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    if (i != 1 && nodes_[i].cluster == kNone) (void)update(static_cast<std::uint32_t>(i));
  }
}

void MatchTree::set_leaf(std::uint32_t node, std::uint32_t cluster, const Box4& box) noexcept {
  Cluster& placed = clusters_[cluster];
  placed.node = node;
  nodes_[node] = {box, 0, cluster, placed.id, placed.count};
}

bool MatchTree::update(std::uint32_t node) noexcept {
  Node& parent = nodes_[node];
  const Node &left = nodes_[parent.first], &right = nodes_[parent.first + 1];
  const Box4 core{max(left.core.lower, right.core.lower), min(left.core.upper, right.core.upper)};
  const std::uint32_t least_id = std::min(left.least_id, right.least_id);
  const std::uint32_t least_count = std::min(left.least_count, right.least_count);
  alignas(16) float now[8], before[8];
  core.lower.store(now), core.upper.store(now + 4);
  parent.core.lower.store(before), parent.core.upper.store(before + 4);
  const bool is_changed =
      least_id != parent.least_id || least_count != parent.least_count || !std::equal(now, now + 8, before);
  parent.core = core;
  parent.least_id = least_id;
  parent.least_count = least_count;
  return is_changed;
}

void MatchTree::update_upwards(std::uint32_t node) noexcept {
  while (node != kNone && update(node)) node = parent_of(node);
}

// Replaces their parent by the removed node's sibling.
void MatchTree::remove(std::uint32_t node) noexcept {
  const std::uint32_t parent = parent_of(node);
  const Node sibling = nodes_[node ^ 1u];
  nodes_[parent] = sibling;
  if (sibling.cluster == kNone) {
    parent_of(sibling.first) = parent;
  } else {
    clusters_[sibling.cluster].node = parent;
  }
  update_upwards(parent_of(parent));
}

std::uint32_t MatchTree::join(std::uint32_t a, std::uint32_t b) {
  // Uses the position of the larger one, whose neighbours are likely to be the union's.
  if (std::pair(clusters_[a].count, clusters_[b].id) < std::pair(clusters_[b].count, clusters_[a].id)) std::swap(a, b);
  const Box4 box = joint(nodes_[clusters_[a].node].core, nodes_[clusters_[b].node].core);
  remove(clusters_[b].node);
  const auto cluster = static_cast<std::uint32_t>(clusters_.size());
  const std::uint32_t node = clusters_[a].node;
  clusters_.push_back({std::min(clusters_[a].id, clusters_[b].id), clusters_[a].count + clusters_[b].count, node});
  set_leaf(node, cluster, box);
  if (node != 0) update_upwards(parent_of(node));
  return cluster;
}

float MatchTree::bound_of(const Query& query, const Node& node) noexcept {
  const Box4 box = joint(node.core, query.box);
  return half_area(box.upper - box.lower);
}

MatchCost MatchTree::full_bound_of(const Query& query, const Node& node, float area) noexcept {
  const Box4 box = joint(node.core, query.box);
  const auto [low_id, high_id] = std::minmax(query.id, node.least_id);
  return {area, sum_of_sides(box.upper - box.lower), query.count + node.least_count, low_id, high_id};
}

bool MatchTree::may_hold_better(const Query& query, const Node& node, float area) noexcept {
  if (area != query.best_cost.area) return area < query.best_cost.area;
  return full_bound_of(query, node, area).is_better_tie(query.best_cost);
}

void MatchTree::take(Query& query, const Node& leaf, float area) noexcept {
  query.best = leaf.cluster;
  query.best_cost = full_bound_of(query, leaf, area);
}

void MatchTree::search(Query& query, std::uint32_t node, float area) noexcept {
  const std::size_t bottom = stack_.size();
  for (;;) {
    if (may_hold_better(query, nodes_[node], area)) {
      if (nodes_[node].cluster != kNone) {
        take(query, nodes_[node], area);
      } else {
        const std::uint32_t first = nodes_[node].first;
        const float left = bound_of(query, nodes_[first]), right = bound_of(query, nodes_[first + 1]);
        const bool is_left_first =
            left < right || (left == right && nodes_[first].least_id < nodes_[first + 1].least_id);
        const std::uint32_t nearer = is_left_first ? first : first + 1;
        const float farther_area = is_left_first ? right : left;
        if (farther_area <= query.best_cost.area) stack_.push_back({nearer ^ 1u, farther_area});
        node = nearer;
        area = is_left_first ? left : right;
        continue;
      }
    }
    if (stack_.size() == bottom) return;
    node = stack_.back().node;
    area = stack_.back().area;
    stack_.pop_back();
  }
}

std::uint32_t MatchTree::find_best(std::uint32_t cluster, std::uint32_t hint) noexcept {
  const Cluster& asking = clusters_[cluster];
  Query query{
      nodes_[asking.node].core, asking.id, asking.count, kNone, {std::numeric_limits<float>::infinity(), 0, 0, 0, 0}};
  if (hint != kNone) {
    const Node& leaf = nodes_[clusters_[hint].node];
    take(query, leaf, bound_of(query, leaf));
  }
  // Searches upwards from the cluster's own node, so the nearest are visited first.
  for (std::uint32_t node = asking.node; node != 0; node = parent_of(node)) {
    const std::uint32_t sibling = node ^ 1u;
    const float area = bound_of(query, nodes_[sibling]);
    if (area <= query.best_cost.area) search(query, sibling, area);
  }
  return query.best;
}

}  // namespace perfect_bvh
