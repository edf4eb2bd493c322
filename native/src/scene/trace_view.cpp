#include "scene/trace_view.h"

#include <algorithm>

namespace perfect_bvh {
namespace {

// A visit takes one entry off the stack and puts at most 8 on it.
constexpr std::uint32_t entries_for(std::uint32_t depth) { return 7 * depth + 1; }

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
  parallel_for(pool, views.size(), kGrain, divide, 0, [&] { cancel.checkpoint(); });
}

}  // namespace

IndexedLeaves view_leaves(const WideBvh& tree, const TriangleMesh& mesh) noexcept {
  return {tree.indexed_leaves.data(), mesh.triangles.data(), mesh.positions.data(), tree.scale};
}

InstanceView view_of(const Instance& instance, const Affine& world_to_object) {
  const WideBvh& tree = instance.blas->wide;
  InstanceView view;
  const double scale = static_cast<double>(tree.scale);
  const Vec3d columns[4] = {world_to_object.x, world_to_object.y, world_to_object.z, world_to_object.translation};
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) view.world_to_local[column][row] = columns[column][row] * scale;
    view.world_to_local[column][3] = 0;
  }
  view.nodes = tree.nodes.data();
  view.is_compact = tree.layout == TreeLayout::kCompact ? 1 : 0;
  if (view.is_compact != 0) {
    view.indexed_leaves = &instance.blas->indexed_leaves;
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
  return view;
}

void make_trace_view(Snapshot& snapshot, ThreadPool& pool, CancelToken& cancel) {
  bring_to_scale(snapshot.instance_views, static_cast<double>(snapshot.top_level.scale), pool, cancel);
  std::uint32_t deepest = 0;
  SceneView& view = snapshot.view;
  view.repeats_triangles = false;
  std::size_t bytes = snapshot.top_level.byte_count() + snapshot.instance_views.size() * sizeof(InstanceView);
  for (const auto& blas : snapshot.blases) {
    bytes += blas->wide.byte_count();
    deepest = std::max(deepest, blas->wide.depth);
    view.repeats_triangles = view.repeats_triangles || blas->wide.repeats_triangles;
  }
  const WideBvh& top = snapshot.top_level;
  view.nodes = top.nodes.data();
  view.instances = snapshot.instance_views.data();
  static_assert(sizeof(Affine) == 12 * sizeof(double));
  view.places = snapshot.instances.empty() ? nullptr : &snapshot.instances.front().object_to_world.x.x;
  view.place_stride = sizeof(Instance);
  view.extent = top.extent;
  view.scale = top.scale;
  view.root = top.root;
  view.is_empty = top.is_empty;
  view.exceeds_cache = bytes > kCachedBytes;
  constexpr std::uint32_t kMarks = 2;  // the end of the ray, and the way back from an instance
  view.stack_entries = entries_for(top.depth) + entries_for(deepest) + kMarks;
}

}  // namespace perfect_bvh
