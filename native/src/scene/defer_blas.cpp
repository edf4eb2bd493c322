// Scene::defer_blas: of a mesh whose tree waits for the first ray that reaches it, what its instances are placed by.

#include "builders/builder.h"
#include "core/stopwatch.h"
#include "scene/blas_build.h"
#include "scene/deferred_tree.h"
#include "scene/scene.h"

namespace perfect_bvh {
namespace {

const char* why_deferred(bool is_new, bool same_topology) {
  if (is_new) return "new mesh; its tree is built when a ray reaches it";
  return same_topology ? "positions changed; no ray has reached the mesh yet"
                       : "the triangles were replaced; no ray has reached the mesh yet";
}

}  // namespace

// A mesh that a ray has reached will be reached again: it is treated like any other from then on.
bool Scene::is_deferred(const MeshSlot& slot) noexcept { return slot.is_lazy && (!slot.blas || slot.blas->deferred); }

Scene::BlasResult Scene::defer_blas(const ChangedMesh& changed, const CommitOptions& options) {
  const Stopwatch watch;
  const MeshSlot& slot = *changed.slot;
  BlasResult result;
  auto blas = std::make_shared<Blas>(slot.edited);
  blas->config = choose_builder(slot.config, slot.usage);
  blas->cover = make_cover(cover_boxes(blas->mesh, kCoverBoxes));
  MeshSlot fresh;
  fresh.config = slot.config, fresh.usage = slot.usage, fresh.edited = slot.edited;
  const auto build = [fresh, options, mesh_id = changed.mesh_id, rays = changed.rays](ThreadPool& pool,
                                                                                      CancelToken& cancel) {
    BlasResult made = make_blas({mesh_id, &fresh, rays}, options, pool, cancel);
    return BuiltTree{std::move(made.blas), made.history};
  };
  blas->deferred = std::make_shared<DeferredTree>(build);
  MeshReport& report = result.report;
  report.mesh_id = changed.mesh_id;
  report.usage = usage_name(slot.usage);
  report.expected_rays = changed.rays;
  report.action = MeshAction::kDeferred;
  report.reason = why_deferred(slot.blas == nullptr, slot.same_topology);
  report.builder = builder_name(blas->config.builder);
  report.layout = layout_name(blas->config.layout);
  report.triangle_count = blas->mesh.triangle_count();
  report.byte_count = blas->mesh.byte_count();
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

void Scene::adopt_built_trees() {
  for (auto& [mesh_id, slot] : meshes_) {
    if (!slot.blas || !slot.blas->deferred) continue;
    BuiltTree built = slot.blas->deferred->if_built();
    if (!built.blas) continue;
    slot.blas = std::move(built.blas);
    slot.history = built.history;
  }
}

}  // namespace perfect_bvh
