#include "query/tree_boxes.h"

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "blas/build_tree.h"
#include "builders/quality.h"
#include "core/cancel.h"
#include "mesh/round_mesh.h"
#include "wide/wide_bvh.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {
namespace {

// A child in its parent's view.
struct Entry {
  std::uint32_t child;
  Aabb box;
  float overlap;
};

// Returns the sum of the areas that a child shares with each of the others; it exceeds the child's own area if several
// cover it.
double shared_area(const WideNode& node, std::uint32_t lane) noexcept {
  const Aabb own = child_box(node, lane);
  double sum = 0;
  for (std::uint32_t other = 0; other < kWideWidth; ++other) {
    if (other == lane || node.child[other] == kNoChild) continue;
    sum += shared_half_area(own, child_box(node, other));
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

// The contents below a child: a range of the list of all primitives, and the sum of costs, times the root's area.
struct Subtree {
  std::int64_t begin = 0, end = 0;
  double cost = 0;
};

// Visits a whole tree depth first, so that the contents below a child are one range of the list.
class SubtreeLister {
 public:
  // instances: those of a top level, else empty.
  SubtreeLister(const WideBvh& tree, std::span<const Instance> instances)
      : tree_(tree), instances_(instances), nodes_(tree.nodes.size()) {
    leaves_.resize(instances.empty() ? tree.leaf_count() : instances.size());
  }

  void list(double root_area, CancelToken& cancel) {
    open(tree_.root, root_area);
    for (Steps steps(cancel); !ways_.empty();) {
      steps.step();
      Way& way = ways_.back();
      const WideNode& node = tree_.nodes[way.row];
      while (way.lane < kWideWidth && node.child[way.lane] == kNoChild) ++way.lane;
      if (way.lane < kWideWidth) {
        const std::uint32_t lane = way.lane++;  // first: `way` moves when another is pushed
        open(node.child[lane], half_area(child_box(node, lane)));
      } else {
        close();
      }
    }
  }

  [[nodiscard]] const Subtree& of(std::uint32_t child) const noexcept {
    return child < kBlockChild ? nodes_[child] : leaves_[row_of(child)];
  }
  [[nodiscard]] std::vector<std::int32_t>& primitives() noexcept { return primitives_; }

  [[nodiscard]] std::int32_t leaf_size(std::uint32_t child) const noexcept {
    if (child < kBlockChild) return 0;
    if (child >= kInstanceChild) return 1;
    return static_cast<std::int32_t>(triangle_count_of(tree_, row_of(child)));
  }

 private:
  struct Way {
    std::uint32_t row, lane;
  };

  static std::uint32_t row_of(std::uint32_t leaf) noexcept {
    return leaf - (leaf >= kInstanceChild ? kInstanceChild : kBlockChild);
  }

  void open(std::uint32_t child, double area) {
    const auto begin = static_cast<std::int64_t>(primitives_.size());
    if (child < kBlockChild) {
      nodes_[child] = {begin, begin, area};
      ways_.push_back({child, 0});
      return;
    }
    add_primitives(child);
    const auto end = static_cast<std::int64_t>(primitives_.size());
    leaves_[row_of(child)] = {begin, end, area * static_cast<double>(end - begin)};
    if (!ways_.empty()) nodes_[ways_.back().row].cost += leaves_[row_of(child)].cost;
  }

  void close() {
    Subtree& done = nodes_[ways_.back().row];
    done.end = static_cast<std::int64_t>(primitives_.size());
    ways_.pop_back();
    if (!ways_.empty()) nodes_[ways_.back().row].cost += done.cost;
  }

  void add_primitives(std::uint32_t leaf) {
    if (leaf >= kInstanceChild) {
      primitives_.push_back(instances_[row_of(leaf)].id);
      return;
    }
    const std::uint32_t* const found = primitives_of(tree_, row_of(leaf));
    const std::int32_t count = leaf_size(leaf);
    for (std::int32_t i = 0; i < count; ++i) primitives_.push_back(static_cast<std::int32_t>(found[i]));
  }

  const WideBvh& tree_;
  const std::span<const Instance> instances_;
  std::vector<Subtree> nodes_, leaves_;  // by row
  std::vector<std::int32_t> primitives_;
  std::vector<Way> ways_;  // from the root to the present node
};

// Goes down a tree level by level.
class BoxLister {
 public:
  BoxLister(const WideBvh& tree, const Aabb& bounds, Vec3d centre, std::span<const Instance> instances = {})
      : tree_(tree), bounds_(bounds), centre_(centre), root_area_(half_area(bounds)), subtrees_(tree, instances) {}

  // built_sah: 0 for a tree that was not refitted.
  TreeBoxes list(LevelRange levels, double built_sah, CancelToken& cancel) {
    if (tree_.is_empty) return {};
    subtrees_.list(root_area_, cancel);
    boxes_.depth = tree_.depth;
    boxes_.sah = share_of(tree_.root, subtrees_.of(tree_.root).cost);
    boxes_.built_sah = built_sah > 0 ? built_sah : boxes_.sah;
    std::vector<Entry> entries{{tree_.root, bounds_, 0.0f}}, below;
    for (std::uint32_t level = 0; !entries.empty() && level <= levels.last; ++level) {
      cancel.checkpoint();
      below.clear();
      for (const Entry& entry : entries) {
        const bool is_leaf = entry.child >= kBlockChild;
        if (level >= levels.first || (is_leaf && levels.with_leaves_above)) add(entry, level);
        if (entry.child < kBlockChild && level < levels.last) add_children(tree_.nodes[entry.child], below);
      }
      entries.swap(below);
    }
    boxes_.primitives = std::move(subtrees_.primitives());
    return std::move(boxes_);
  }

 private:
  void add(const Entry& entry, std::uint32_t level) {
    const double scale = static_cast<double>(tree_.scale);
    for (const Vec3f corner : {entry.box.lower, entry.box.upper}) {
      const Vec3d place = to_double(corner) * (1.0 / scale) + centre_;
      boxes_.corners.insert(boxes_.corners.end(), {place.x, place.y, place.z});
    }
    const std::int32_t size = subtrees_.leaf_size(entry.child);
    const Subtree& below = subtrees_.of(entry.child);
    const double whole = share_of(entry.child, below.cost);
    const double own = size > 0 ? whole : (root_area_ > 0 ? half_area(entry.box) / root_area_ : 0.0);
    boxes_.levels.push_back(static_cast<std::int32_t>(level));
    boxes_.leaf_sizes.push_back(size);
    boxes_.costs.push_back(static_cast<float>(own));
    boxes_.subtree_costs.push_back(static_cast<float>(whole));
    boxes_.overlaps.push_back(entry.overlap);
    boxes_.ranges.insert(boxes_.ranges.end(), {below.begin, below.end});
  }

  // No random ray hits a tree without area. Its number of triangles is used instead, as for any ray that does hit it.
  [[nodiscard]] double share_of(std::uint32_t child, double cost) const noexcept {
    if (root_area_ > 0) return cost / root_area_;
    const Subtree& below = subtrees_.of(child);
    return static_cast<double>(below.end - below.begin);
  }

  const WideBvh& tree_;
  const Aabb bounds_;
  const Vec3d centre_;
  const double root_area_;
  SubtreeLister subtrees_;
  TreeBoxes boxes_;
};

const Blas& find_mesh(const Snapshot& snapshot, std::int32_t mesh_id, const char* function) {
  for (const auto& [id, blas] : snapshot.meshes) {
    if (id == mesh_id) return *blas;
  }
  throw InvalidArgument(std::string(function) + ": mesh_id " + std::to_string(mesh_id) + " is not in this snapshot");
}

}  // namespace

Aabb bounds_of_top_level(const Snapshot& snapshot) {
  const WideBvh& tree = snapshot.top_level;
  if (tree.is_empty) return {};
  if (tree.root < kBlockChild) return node_box(tree.nodes[tree.root]);
  return {snapshot.lone_box.lower * tree.scale, snapshot.lone_box.upper * tree.scale};
}

TreeBoxes list_tree_boxes(const Snapshot& snapshot, std::optional<std::int32_t> mesh_id, LevelRange levels,
                          CancelToken& cancel) {
  if (!mesh_id) {
    const TopLevelCost& built = snapshot.built_cost;
    return BoxLister(snapshot.top_level, bounds_of_top_level(snapshot), {0, 0, 0}, snapshot.instances)
        .list(levels, built.node_visits + built.instance_entries, cancel);
  }
  const Blas& blas = find_mesh(snapshot, *mesh_id, "tree_boxes");
  return BoxLister(blas.wide, bounds_of(blas.wide, blas.mesh), blas.mesh.centre).list(levels, blas.built_sah, cancel);
}

double tree_sah(const Snapshot& snapshot, std::int32_t mesh_id, CancelToken& cancel) {
  const Blas& blas = find_mesh(snapshot, mesh_id, "tree_sah");
  return measure_sah(blas.wide, blas.mesh, cancel);
}

// Statistics ----------------------------------------------------------------------------------------------------------

namespace {

// Enough to know the standard deviation to half a percent.
constexpr std::uint32_t kLineCount = 16384;

void add(PrimitiveCounts& counts, const Mesh& mesh) {
  with_kind(mesh.kind, [&](auto kind) { counts.*kind.kCounted += kind.count(mesh); });
}

TreeStatistics describe(const TreeQuality& quality) {
  TreeStatistics row;
  row.node_count = quality.node_count;
  row.leaf_count = quality.leaf_count;
  row.reference_count = quality.reference_count;
  row.max_leaf_size = quality.max_leaf_size;
  row.depth = quality.depth;
  row.is_refittable = quality.is_refittable;
  row.sah = quality.sah;
  row.sibling_overlap = quality.sibling_overlap;
  return row;
}

void add_bytes(TreeStatistics& row, std::size_t geometry, const WideBvh& wide) {
  row.wide_node_count = wide.nodes.size();
  row.wide_leaf_count = wide.leaf_count();
  row.wide_depth = wide.depth;
  row.geometry_byte_count = geometry;
  row.wide_byte_count = wide.byte_count();
  row.byte_count = row.geometry_byte_count + row.wide_byte_count;
}

TreeStatistics describe_mesh(std::int32_t mesh_id, const Blas& blas) {
  const bool was_binary = blas.quality.node_count > 0;
  TreeStatistics row =
      describe(was_binary ? blas.quality : measure_wide_quality(blas.wide, bounds_of(blas.wide, blas.mesh)));
  row.mesh_id = mesh_id;
  row.builder = builder_name(blas.config.builder);
  row.kind = names_of(blas.mesh.kind).kind;
  row.primitive_count = blas.mesh.primitive_count();
  row.vertex_count = blas.mesh.vertex_count();
  row.left_out_count = left_out_count(blas.mesh);
  add_bytes(row, blas.mesh.byte_count(), blas.wide);
  row.plan_byte_count = plan_byte_count(blas);
  row.motion_byte_count = motion_byte_count(blas);
  row.byte_count += row.plan_byte_count + row.motion_byte_count;
  return row;
}

TreeStatistics describe_top_level(const Snapshot& snapshot) {
  TreeStatistics row = describe(measure_wide_quality(snapshot.top_level, bounds_of_top_level(snapshot)));
  row.builder = snapshot.top_level_builder;
  row.kind = "instances";
  row.primitive_count = snapshot.instances.size();
  row.user_count = 1;
  add_bytes(row, snapshot.instances.size() * (sizeof(Instance) + sizeof(InstanceView)), snapshot.top_level);
  row.motion_byte_count = motion_byte_count(snapshot);
  row.byte_count += row.motion_byte_count;
  return row;
}

// Only its leaves are measured, so any binary tree serves. Empty for a single instance.
Bvh2 binary_top_level(const Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<PrimRef> boxes;
  const auto& nodes = snapshot.top_level.nodes;
  for_steps(nodes.size() * kWideWidth, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto lane = static_cast<std::uint32_t>(i % kWideWidth), child = nodes[i / kWideWidth].child[lane];
      const Aabb box = child_box(nodes[i / kWideWidth], lane);
      if (child >= kInstanceChild) boxes.push_back({box.lower, child, box.upper, 0});
    }
  });
  BuildConfig config;
  config.builder = BuilderKind::kFast, config.max_leaf_size = 1;
  return build_bvh2(boxes, config, pool, cancel);
}

// Builders are deterministic: a rebuilt tree equals the old one.
void add_details(TreeStatistics& row, const Blas& blas, ThreadPool& pool, CancelToken& cancel) {
  if (blas.quality.node_count == 0 && !blas.wide.is_empty) {  // there is no binary tree to measure
    cancel.advance(2 * blas.mesh.primitive_count());
    return;
  }
  const Bvh2 tree = blas.mesh.primitive_count() > 0 ? build_tree(blas.mesh, blas.config, pool, cancel) : Bvh2{};
  if (blas.mesh.is_round()) {
    cancel.advance(blas.mesh.primitive_count());  // EPO measures the surfaces of triangles only
  } else {
    row.epo = measure_epo(tree, blas.mesh.positions, blas.mesh.triangles, pool, cancel);
  }
  row.leaf_count_variability = measure_leaf_count_variability(tree, kLineCount, pool, cancel);
}

}  // namespace

SceneStatistics measure(const Snapshot& snapshot, bool is_detailed, ThreadPool& pool, CancelToken& cancel) {
  SceneStatistics result;
  std::map<std::int32_t, std::size_t> rows;
  std::size_t primitive_count = 0;
  for (const auto& [mesh_id, blas] : snapshot.meshes) {
    rows[mesh_id] = result.meshes.size();
    result.meshes.push_back(describe_mesh(mesh_id, *blas));
    add(result.distinct, blas->mesh);
    primitive_count += blas->mesh.primitive_count();
  }
  result.top_level = describe_top_level(snapshot);
  if (is_detailed) {
    cancel.expect(2 * primitive_count);
    for (std::size_t i = 0; i < snapshot.meshes.size(); ++i) {
      add_details(result.meshes[i], *snapshot.meshes[i].second, pool, cancel);
    }
    const Bvh2 binary = binary_top_level(snapshot, pool, cancel);
    result.top_level.leaf_count_variability = measure_leaf_count_variability(binary, kLineCount, pool, cancel);
  }
  for (const Instance& instance : snapshot.instances) {
    add(result.instanced, instance.blas->mesh);
    if (const auto row = rows.find(instance.mesh_id); row != rows.end()) ++result.meshes[row->second].user_count;
  }
  result.instance_count = snapshot.instances.size();
  result.generation = snapshot.generation;
  result.byte_count = result.top_level.byte_count;
  for (const auto& blas : snapshot.blases) result.byte_count += byte_count(*blas);
  return result;
}

}  // namespace perfect_bvh
