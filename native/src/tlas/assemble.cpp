#include "tlas/assemble.h"

#include <algorithm>
#include <cstring>
#include <mutex>

#include "core/cancel.h"
#include "core/errors.h"
#include "math/vec3.h"
#include "tlas/instance.h"
#include "tlas/moving_bounds.h"
#include "tlas/top_level.h"
#include "wide/collapse.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 1024;  // instances placed by one task

// A table of a mesh's support takes 40 us to 1 ms to make, as long as going through this many vertices. Without a
// table, each instance goes through all vertices of the mesh.
constexpr std::size_t kManyVertices = std::size_t{1} << 17;
constexpr std::uint32_t kManyUsers = 64;

bool is_worth_table(const PlacedMesh& mesh) noexcept {
  return mesh.user_count >= kManyUsers || mesh.user_count * mesh.blas->mesh.vertex_count() > kManyVertices;
}

// The copies of instances without a usable inverse, made on any thread.
class BakedCopies {
 public:
  void add(std::size_t row, std::shared_ptr<const Blas> blas) {
    const std::lock_guard lock(mutex_);
    copies_.emplace_back(row, std::move(blas));
  }
  // Appends them in the order of the rows.
  void move_to(std::vector<std::shared_ptr<const Blas>>& blases) {
    std::sort(copies_.begin(), copies_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [row, blas] : copies_) blases.push_back(std::move(blas));
  }

 private:
  std::mutex mutex_;
  std::vector<std::pair<std::size_t, std::shared_ptr<const Blas>>> copies_;
};

// Refits the trees if the instances are the same and only moved.
bool try_refit(Snapshot& snapshot, std::span<const PrimRef> boxes, std::optional<double> expected_rays,
               TopLevelReport& report, ThreadPool& pool, CancelToken& cancel) {
  if (snapshot.top_level.is_empty) {
    report.reason = "there was no tree";
    return false;
  }
  if (!is_over(snapshot.top_level, boxes, cancel)) {
    report.reason = "instances were added or removed";
    return false;
  }
  const Stopwatch watch;
  refit_boxes(snapshot.top_level, boxes, pool, cancel);
  const TopLevelCost cost = measure_cost(snapshot.top_level, pool, cancel);
  const bool is_kept =
      is_worth_keeping(cost, snapshot.built_cost, boxes.size(), snapshot.tried_clustering, expected_rays);
  if (is_kept) finish_refit(snapshot.top_level, pool, cancel);
  report.refit_milliseconds = watch.milliseconds();
  report.reason = describe(cost, snapshot.built_cost) + (is_kept ? "" : ", so a new tree pays off");
  return is_kept;
}

void drop_empty(AlignedVector<PrimRef>& boxes, CancelToken& cancel) {
  std::size_t kept = 0;
  for_steps(boxes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (boxes[i].box().is_empty()) continue;
      if (kept != i) boxes[kept] = boxes[i];
      ++kept;
    }
  });
  boxes.resize(kept);
}

void build(Snapshot& snapshot, AlignedVector<PrimRef>& boxes, std::optional<double> expected_rays,
           TopLevelReport& report, ThreadPool& pool, CancelToken& cancel) {
  drop_empty(boxes, cancel);
  TopLevel top = build_top_level(boxes, pool, cancel, kMostClusters, expected_rays);
  snapshot.tried_clustering = top.tried_clustering;
  snapshot.top_level_builder = top.builder;
  report.build_milliseconds = top.build_milliseconds;
  report.clustering_milliseconds = top.clustering_milliseconds;
  const Stopwatch watch;
  snapshot.top_level = top.tree.empty() ? std::move(top.wide) : collapse_top_level(top.tree, pool, cancel);
  snapshot.built_cost = measure_cost(snapshot.top_level, pool, cancel);
  report.collapse_milliseconds = watch.milliseconds();
}

// Returns a box for each instance, empty if its mesh is empty.
AlignedVector<PrimRef> place_instances(Snapshot& snapshot, const PlacedMeshes& meshes,
                                       std::span<const Placement> placements, ThreadPool& pool, CancelToken& cancel) {
  const std::size_t count = placements.size();
  if (count > kMostInstances) throw EngineError("the scene has more instances than a tree can refer to");
  // The memory of the last snapshot stays; none of its rows is moved.
  snapshot.instances.clear(), snapshot.instance_views.clear(), snapshot.turns.clear();
  snapshot.instances.resize(count), snapshot.instance_views.resize(count);
  AlignedVector<PrimRef> boxes(count);
  BakedCopies baked;
  std::mutex mutex;
  Aabb bounds;
  const auto place = [&](std::size_t begin, std::size_t end) {
    auto found = meshes.end();
    bool has_table = false;
    std::size_t vertex_count = 0;  // visited since the last check
    Aabb part;
    std::vector<std::shared_ptr<const Turns>> turns;
    for (std::size_t i = begin; i < end; ++i) {
      const Placement& slot = placements[i];
      if (found == meshes.end() || found->first != slot.mesh_id) {
        found = meshes.find(slot.mesh_id);
        has_table = is_worth_table(found->second);
      }
      const Blas& blas = *found->second.blas;
      if (!has_table && (vertex_count += blas.mesh.vertex_count()) > kManyVertices) {
        vertex_count = 0;
        cancel.checkpoint();
      }
      Instance& instance = snapshot.instances[i];
      instance.id = slot.id, instance.mesh_id = slot.mesh_id, instance.mask = slot.mask, instance.order = slot.order;
      Placing placing;
      // A turning instance has a map at each of its steps. It is invisible at moments at which it is flat.
      if (!place_instance(instance, placing, blas, slot.object_to_world, has_table) && slot.turns == nullptr) {
        const BuildConfig& config = found->second.bake_config;
        baked.add(i, bake_instance(instance, placing, blas, slot.object_to_world, config, pool, cancel));
      }
      instance.turns = slot.turns.get();
      if (slot.turns) turns.push_back(slot.turns);
      snapshot.instance_views[i] = view_of(instance, placing.world_to_object);
      boxes[i] = {placing.world_bounds.lower, static_cast<std::uint32_t>(i), placing.world_bounds.upper, 0};
      part.grow(mesh_bounds_of(instance));
    }
    const std::lock_guard lock(mutex);
    bounds.grow(part);
    snapshot.turns.insert(snapshot.turns.end(), turns.begin(), turns.end());
  };
  for_chunks(pool, count, kGrain, cancel, place);
  snapshot.bounds = bounds;
  baked.move_to(snapshot.blases);
  return boxes;
}

// Makes the top level at the times of the shutter; none if the whole one serves all times.
void add_top_steps(Snapshot& snapshot, const StepBoxes& boxes, ThreadPool& pool, CancelToken& cancel) {
  if (boxes.empty()) return;
  const std::size_t middle = boxes.size() / 2;
  WideBvh between = refitted_at_step(snapshot.top_level, boxes[middle], pool, cancel);
  if (serves_all_times(snapshot.top_level, between, pool, cancel)) return;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    snapshot.top_steps.push_back(i == middle ? std::move(between)
                                             : refitted_at_step(snapshot.top_level, boxes[i], pool, cancel));
  }
}

}  // namespace

TopLevelReport assemble(Snapshot& snapshot, const PlacedMeshes& meshes, std::span<const Placement> placements,
                        std::optional<double> expected_rays, ThreadPool& pool, CancelToken& cancel) {
  const Stopwatch watch;
  TopLevelReport report;
  snapshot.blases.clear(), snapshot.meshes.clear();
  snapshot.has_round_meshes = false;
  snapshot.top_steps.clear();
  AlignedVector<PrimRef> boxes = place_instances(snapshot, meshes, placements, pool, cancel);
  for (const auto& [mesh_id, mesh] : meshes) {
    snapshot.blases.push_back(mesh.blas);
    snapshot.has_round_meshes |= mesh.blas->mesh.is_round();
    snapshot.meshes.emplace_back(mesh_id, mesh.blas.get());
  }
  const StepBoxes step_boxes = add_motions(snapshot, boxes, pool, cancel);
  report.placing_milliseconds = watch.milliseconds();
  report.is_refitted = try_refit(snapshot, boxes, expected_rays, report, pool, cancel);
  if (!report.is_refitted) build(snapshot, boxes, expected_rays, report, pool, cancel);
  for (const PrimRef& ref : boxes) {
    if (!snapshot.top_level.nodes.empty()) break;
    if (kInstanceChild + ref.prim_index == snapshot.top_level.root) snapshot.lone_box = ref.box();
  }
  add_top_steps(snapshot, step_boxes, pool, cancel);
  make_trace_view(snapshot, pool, cancel);
  return report;
}

// Trace view ----------------------------------------------------------------------------------------------------------

namespace {

// A visit pops one entry and pushes at most 8.
constexpr std::uint32_t entries_for(std::uint32_t depth) { return 7 * depth + 1; }
constexpr std::uint32_t kMarks = 2;  // the end of the ray, and the return from an instance

// The scale is a power of two, so nothing is rounded.
void bring_to_scale(AlignedVector<InstanceView>& views, double world_scale, ThreadPool& pool, CancelToken& cancel) {
  if (world_scale == 1.0) return;
  constexpr std::size_t kScaleGrain = 4096;
  const auto divide = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (int column = 0; column < 3; ++column) {
        for (double& entry : views[i].world_to_local[column]) entry /= world_scale;
      }
    }
  };
  for_chunks(pool, views.size(), kScaleGrain, cancel, divide);
}

// Extends the view's limits for rays that go through a tree.
void admit_tree(SceneView& view, const WideBvh& top_level, const WideBvh& tree) {
  view.stack_entries = std::max(view.stack_entries, entries_for(top_level.depth) + entries_for(tree.depth) + kMarks);
  view.repeats_triangles = view.repeats_triangles || tree.repeats_triangles;
  view.tree_bytes += tree.byte_count();
  view.exceeds_cache = view.tree_bytes > kCachedBytes;
}

// Finds SceneView::in_place. Its tree must be within the boxes of the top level, and not small: only then does it pay.
const InstanceView* find_in_place(const Snapshot& snapshot, CancelToken& cancel) {
  constexpr double kIdentity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const SceneView& scene = snapshot.view;
  const bool is_lone = scene.root >= kInstanceChild;
  const InstanceView* found = nullptr;
  float most = is_lone ? 0.0f : 0.5f * scene.reach;
  for (std::uint32_t row = 0; row < snapshot.instance_views.size(); ++row) {
    if (row % kGrain == 0) cancel.checkpoint();
    const InstanceView& view = snapshot.instance_views[row];
    if (!(view.extent.reach > most) || view.mask == 0) continue;
    if (std::memcmp(view.world_to_local, kIdentity, sizeof(kIdentity)) != 0) continue;
    if (view.motion != 0 && snapshot.motions[view.motion - 1].backs != nullptr) continue;
    const auto exceeds = [&](int axis) { return view.extent.largest[axis] > scene.extent.largest[axis]; };
    if (is_lone ? row != scene.root - kInstanceChild : exceeds(0) || exceeds(1) || exceeds(2)) continue;
    found = &view, most = view.extent.reach;
  }
  return found;
}

}  // namespace

InstanceView view_of(const Instance& instance, const Affine& world_to_object) {
  const WideBvh& tree = instance.blas->wide;
  InstanceView view;
  const double scale = static_cast<double>(tree.scale);
  const Vec3d columns[4] = {world_to_object.x, world_to_object.y, world_to_object.z, world_to_object.translation};
  for (int column = 0; column < 4; ++column) {
    // No minus zero: kernels skip an identity map (SceneView::in_place).
    for_each_axis([&](auto row) { view.world_to_local[column][row] = columns[column][row] * scale + 0.0; });
    view.world_to_local[column][3] = 0;
  }
  view.nodes = tree.nodes.data();
  view.is_round = instance.blas->mesh.is_round() ? 1 : 0;
  view.leaves = view_leaves(*instance.blas);
  view.extent = tree.extent;
  view.root = tree.root;
  view.mask = tree.is_empty ? 0 : instance.mask;
  view.mirrored = instance.mirrored ? 1 : 0;
  view.id = instance.id;
  view.order = instance.order;
  view.scale = tree.scale;
  view.motion = instance.motion;
  return view;
}

void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel) {
  bring_to_scale(snapshot.instance_views, static_cast<double>(snapshot.top_level.scale), pool, cancel);
  const WideBvh& top = snapshot.top_level;
  SceneView& view = snapshot.view;
  view = {};
  view.tree_bytes = top.byte_count() + snapshot.instance_views.size() * sizeof(InstanceView);
  admit_tree(view, top, WideBvh{});
  for (const auto& blas : snapshot.blases) admit_tree(view, top, blas->wide);
  view.nodes = top.nodes.data();
  view.instances = snapshot.instance_views.data();
  static_assert(sizeof(Affine) == 12 * sizeof(double));
  view.places = snapshot.instances.empty() ? nullptr : &snapshot.instances.front().object_to_world.x.x;
  view.place_stride = sizeof(Instance);
  view.extent = top.extent;
  view.reach = static_cast<float>(reach_of(snapshot.bounds)) * top.scale;
  view.scale = top.scale;
  view.root = top.root;
  view.is_empty = top.is_empty;
  view.in_place = find_in_place(snapshot, cancel);
  if (snapshot.motions.empty()) return;
  view.motions = snapshot.motions.data();
  view.is_mostly_still = snapshot.is_mostly_still;
  view.tree_bytes += motion_byte_count(snapshot);
  for (const auto& blas : snapshot.blases) view.tree_bytes += motion_byte_count(*blas);
  view.exceeds_cache = view.tree_bytes > kCachedBytes;
  snapshot.top_step_views.clear();
  const auto add_step = [&](const WideBvh& step) {
    TreeStep step_view;
    step_view.nodes = step.nodes.data(), step_view.leaves.blocks = nullptr;
    snapshot.top_step_views.push_back(step_view);
  };
  for (const WideBvh& step : snapshot.top_steps) add_step(step);
  if (snapshot.top_steps.empty()) add_step(top);
  view.top_steps = snapshot.top_step_views.data();
  const auto last = static_cast<std::uint32_t>(snapshot.top_step_views.size() - 1);
  view.top_times = {0.0f, static_cast<float>(last), last};
}

}  // namespace perfect_bvh
