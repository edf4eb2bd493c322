#include "scene/trace_view.h"

#include <algorithm>

#include "wide/collapse.h"

namespace perfect_bvh {
namespace {

// Both levels may be stored in a scale of their own.
InstanceView view_of(const Instance& instance, double world_scale) {
  const WideBvh& tree = instance.blas->wide;
  InstanceView view{};
  const Affine& map = instance.world_to_object;
  const double scale = static_cast<double>(tree.scale);
  const Vec3d columns[4] = {map.x, map.y, map.z, map.translation};
  for (int column = 0; column < 4; ++column) {
    const double factor = column < 3 ? scale / world_scale : scale;
    for (int row = 0; row < 3; ++row) view.world_to_local[column][row] = columns[column][row] * factor;
  }
  view.nodes = tree.nodes.data();
  view.blocks = tree.blocks.data();
  view.extent = tree.extent;
  view.root = tree.root;
  view.mask = tree.is_empty ? 0 : instance.mask;
  view.mirrored = instance.mirrored ? 1 : 0;
  view.id = instance.id;
  view.order = instance.order;
  return view;
}

// A visit takes one entry off the stack and puts at most 8 on it.
constexpr std::uint32_t entries_for(std::uint32_t depth) { return 7 * depth + 1; }

}  // namespace

void make_trace_view(Snapshot& snapshot, CancelToken& cancel) {
  snapshot.top_level = collapse_top_level(snapshot.tlas, cancel);
  snapshot.instance_views.resize(snapshot.instances.size());
  std::transform(snapshot.instances.begin(), snapshot.instances.end(), snapshot.instance_views.begin(),
                 [&](const Instance& instance) { return view_of(instance, snapshot.top_level.scale); });
  std::uint32_t deepest = 0;
  for (const auto& blas : snapshot.blases) deepest = std::max(deepest, blas->wide.depth);
  const WideBvh& top = snapshot.top_level;
  SceneView& view = snapshot.view;
  view.nodes = top.nodes.data();
  view.instances = snapshot.instance_views.data();
  view.extent = top.extent;
  view.scale = top.scale;
  view.root = top.root;
  view.is_empty = top.is_empty;
  constexpr std::uint32_t kMarks = 2;  // the end of the ray, and the way back from an instance
  view.stack_entries = entries_for(top.depth) + entries_for(deepest) + kMarks;
}

}  // namespace perfect_bvh
