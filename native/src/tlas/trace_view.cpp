#include "tlas/trace_view.h"

#include <algorithm>

#include "core/steps.h"
#include "math/axes.h"

namespace perfect_bvh {
namespace {

// A visit takes one entry off the stack and puts at most 8 on it.
constexpr std::uint32_t entries_for(std::uint32_t depth) { return 7 * depth + 1; }
constexpr std::uint32_t kMarks = 2;  // the end of the ray, and the way back from an instance

// The scale is a power of two, so that nothing is rounded.
void bring_to_scale(AlignedVector<InstanceView>& views, double world_scale, ThreadPool& pool, CancelToken& cancel) {
  if (world_scale == 1.0) return;
  constexpr std::size_t kGrain = 4096;
  const auto divide = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (int column = 0; column < 3; ++column) {
        for (double& entry : views[i].world_to_local[column]) entry /= world_scale;
      }
    }
  };
  for_chunks(pool, views.size(), kGrain, cancel, divide);
}

// Makes room in the view for rays to go through a tree.
void admit_tree(SceneView& view, const WideBvh& top_level, const WideBvh& tree) {
  view.stack_entries = std::max(view.stack_entries, entries_for(top_level.depth) + entries_for(tree.depth) + kMarks);
  view.repeats_triangles = view.repeats_triangles || tree.repeats_triangles;
  view.tree_bytes += tree.byte_count();
  view.exceeds_cache = view.tree_bytes > kCachedBytes;
}

}  // namespace

InstanceView view_of(const Instance& instance, const Affine& world_to_object) {
  const WideBvh& tree = instance.blas->wide;
  InstanceView view;
  const double scale = static_cast<double>(tree.scale);
  const Vec3d columns[4] = {world_to_object.x, world_to_object.y, world_to_object.z, world_to_object.translation};
  for (int column = 0; column < 4; ++column) {
    // No minus zero: kernels take an identity for no map at all (LoneInstance).
    for_each_axis([&](auto row) { view.world_to_local[column][row] = columns[column][row] * scale + 0.0; });
    view.world_to_local[column][3] = 0;
  }
  view.nodes = tree.nodes.data();
  view.is_round = instance.blas->mesh.is_round() ? 1 : 0;
  if (view.is_round != 0) {
    view.round_leaves = &instance.blas->round_leaves;
  } else {
    view.blocks = tree.blocks.data();
  }
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
  if (snapshot.motions.empty()) return;
  view.motions = snapshot.motions.data();
  view.is_mostly_still = snapshot.is_mostly_still;
  view.tree_bytes += motion_byte_count(snapshot);
  for (const auto& blas : snapshot.blases) view.tree_bytes += motion_byte_count(*blas);
  view.exceeds_cache = view.tree_bytes > kCachedBytes;
  snapshot.top_step_views.clear();
  const auto add_step = [&](const WideBvh& step) {
    TreeStep step_view;
    step_view.nodes = step.nodes.data(), step_view.blocks = nullptr;
    snapshot.top_step_views.push_back(step_view);
  };
  for (const WideBvh& step : snapshot.top_steps) add_step(step);
  if (snapshot.top_steps.empty()) add_step(top);
  view.top_steps = snapshot.top_step_views.data();
  const auto last = static_cast<std::uint32_t>(snapshot.top_step_views.size() - 1);
  view.top_times = {0.0f, static_cast<float>(last), last};
}

}  // namespace perfect_bvh
