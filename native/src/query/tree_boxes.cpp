#include "query/tree_boxes.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "blas/deferred_tree.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

double half_area(const Aabb& box) noexcept {
  const Vec3d e = to_double(box.upper) - to_double(box.lower);
  return box.is_empty() ? 0 : e.x * e.y + e.y * e.z + e.z * e.x;
}

// A child as its parent knows it.
struct Entry {
  std::uint32_t child;
  Aabb box;
  float overlap;
};

// The area that a child shares with each of the others, together; more than its own where several cover it.
double shared_area(const WideNode& node, std::uint32_t lane) noexcept {
  const Aabb own = child_box(node, lane);
  double sum = 0;
  for (std::uint32_t other = 0; other < kWideWidth; ++other) {
    if (other == lane || node.child[other] == kNoChild) continue;
    const Aabb box = child_box(node, other);
    sum += half_area({max(own.lower, box.lower), min(own.upper, box.upper)});
  }
  return sum;
}

void add_children(const WideNode& node, std::vector<Entry>& entries) {
  for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
    if (node.child[lane] == kNoChild) continue;
    const Aabb box = child_box(node, lane);
    const double area = half_area(box);
    entries.push_back({node.child[lane], box, area > 0 ? static_cast<float>(shared_area(node, lane) / area) : 0.0f});
  }
}

// Goes down a tree, a level at a time.
class BoxLister {
 public:
  BoxLister(const WideBvh& tree, const Aabb& bounds, Vec3d centre)
      : tree_(tree), bounds_(bounds), centre_(centre), root_area_(half_area(bounds)) {}

  TreeBoxes list(LevelRange levels, CancelToken& cancel) {
    if (tree_.is_empty) return {};
    boxes_.depth = tree_.depth;
    std::vector<Entry> entries{{tree_.root, bounds_, 0.0f}}, below;
    for (std::uint32_t level = 0; !entries.empty() && level <= levels.last; ++level) {
      cancel.checkpoint();
      below.clear();
      for (const Entry& entry : entries) {
        if (level >= levels.first) add(entry, level);
        if (entry.child < kBlockChild && level < levels.last) add_children(tree_.nodes[entry.child], below);
      }
      entries.swap(below);
    }
    return std::move(boxes_);
  }

 private:
  void add(const Entry& entry, std::uint32_t level) {
    const double scale = static_cast<double>(tree_.scale);
    for (const Vec3f corner : {entry.box.lower, entry.box.upper}) {
      const Vec3d place = to_double(corner) * (1.0 / scale) + centre_;
      boxes_.corners.insert(boxes_.corners.end(), {place.x, place.y, place.z});
    }
    const std::int32_t size = leaf_size(entry.child);
    // A tree without area is hit by no random ray; its triangles stand in, as for any ray that does meet it.
    const double share = root_area_ > 0 ? half_area(entry.box) / root_area_ : (size > 0 ? 1.0 : 0.0);
    boxes_.levels.push_back(static_cast<std::int32_t>(level));
    boxes_.leaf_sizes.push_back(size);
    boxes_.costs.push_back(static_cast<float>(share * std::max(size, 1)));
    boxes_.overlaps.push_back(entry.overlap);
  }

  [[nodiscard]] std::int32_t leaf_size(std::uint32_t child) const noexcept {
    if (child < kBlockChild) return 0;
    if (child >= kInstanceChild) return 1;
    return static_cast<std::int32_t>(triangle_count_of(tree_, child - kBlockChild));
  }

  const WideBvh& tree_;
  const Aabb bounds_;
  const Vec3d centre_;
  const double root_area_;
  TreeBoxes boxes_;
};

const Blas& find_mesh(const Snapshot& snapshot, std::int32_t mesh_id) {
  for (const auto& [id, blas] : snapshot.meshes) {
    if (id == mesh_id) return newest_of(*blas);
  }
  throw InvalidArgument("tree_boxes: mesh_id " + std::to_string(mesh_id) + " is not in this snapshot");
}

// The top level's own root box, in its stored scale: a root that is an instance has no node around it.
Aabb bounds_of_top_level(const Snapshot& snapshot) {
  const WideBvh& tree = snapshot.top_level;
  if (tree.is_empty) return {};
  if (tree.root < kBlockChild) return node_box(tree.nodes[tree.root]);
  const Aabb box = snapshot.tlas.nodes[0].box();
  return {box.lower * tree.scale, box.upper * tree.scale};
}

}  // namespace

TreeBoxes list_tree_boxes(const Snapshot& snapshot, std::optional<std::int32_t> mesh_id, LevelRange levels,
                          CancelToken& cancel) {
  if (!mesh_id) return BoxLister(snapshot.top_level, bounds_of_top_level(snapshot), {0, 0, 0}).list(levels, cancel);
  const Blas& blas = find_mesh(snapshot, *mesh_id);
  return BoxLister(blas.wide, bounds_of(blas.wide, blas.mesh), blas.mesh.centre).list(levels, cancel);
}

}  // namespace perfect_bvh
