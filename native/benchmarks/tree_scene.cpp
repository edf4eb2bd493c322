#include "tree_scene.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "scene/scene.h"
#include "tlas/assemble.h"
#include "tlas/instance.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh::bench {

std::shared_ptr<const Snapshot> snapshot_over(std::shared_ptr<const Mesh> mesh, WideBvh wide) {
  ThreadPool pool(1);
  CancelToken cancel;
  auto blas = std::make_shared<Blas>(std::move(mesh));
  blas->wide = std::move(wide);
  blas->round_leaves = view_leaves(blas->wide, blas->mesh);
  blas->box = mesh_bounds_of(blas->wide, blas->mesh);
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->blases.push_back(blas);
  Instance& instance = snapshot->instances.emplace_back(Instance{});
  instance.id = 0, instance.mesh_id = 0, instance.blas = blas.get();
  Placing placing;
  if (!place_instance(instance, placing, *blas, Affine{})) throw std::runtime_error("the mesh has no place in a scene");
  const Aabb& box = placing.world_bounds;
  snapshot->instance_views.push_back(view_of(instance, placing.world_to_object));
  snapshot->bounds = mesh_bounds_of(instance);
  snapshot->top_level = build_fast_top_level(std::vector<PrimRef>{{box.lower, 0, box.upper, 0}}, pool, cancel);
  make_trace_view(*snapshot, pool, cancel);
  return snapshot;
}

std::shared_ptr<const Snapshot> committed(const Mesh& mesh, const BuildConfig& config, Usage usage) {
  ThreadPool pool(1);
  CancelToken cancel;
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(mesh, config, usage);
  scene.add_instances(std::vector<InstanceInput>{{mesh_id, Affine{}, ~0u, std::nullopt}});
  scene.commit(pool, cancel, CommitOptions{});
  return scene.snapshot();
}

}  // namespace perfect_bvh::bench
