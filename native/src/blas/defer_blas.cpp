// For a mesh whose tree is built when the first ray reaches it: what its instances are placed by until then.

#include "blas/build_tree.h"
#include "blas/deferred_tree.h"
#include "blas/make_blas.h"
#include "builders/builder.h"
#include "core/steps.h"
#include "core/stopwatch.h"

namespace perfect_bvh {
namespace {

std::string why_deferred(bool is_new, bool same_topology, PrimitiveKind kind) {
  if (is_new) return "new mesh; its tree is built when a ray reaches it";
  return (same_topology ? "positions changed" : std::string("the ") + kind_name(kind) + " were replaced") +
         "; no ray has reached the mesh yet";
}

}  // namespace

// A mesh that a ray has reached will be reached again: it is treated like any other from then on.
// One that moves within the shutter is not put off: where its instances are at each step is known from its trees.
bool is_deferred(const MeshState& state) noexcept {
  return state.is_lazy && (!state.blas || state.blas->deferred) && !(state.edited && state.edited->moves());
}

BlasResult defer_blas(const ChangedMesh& changed, const CommitOptions& options, CancelToken& caller) {
  const Stopwatch watch;
  const MeshState& state = *changed.state;
  BlasResult result;
  auto blas = std::make_shared<Blas>(state.edited);
  blas->config = choose_builder(state.config, state.usage);
  for_steps(blas->mesh.primitive_count(), caller, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) blas->box.grow(blas->mesh.primitive_box(i));
  });
  MeshState fresh;
  fresh.config = state.config, fresh.usage = state.usage, fresh.edited = state.edited;
  const auto build = [fresh, options, asked = changed](ThreadPool& pool, CancelToken& cancel) {
    ChangedMesh alone = asked;
    alone.state = &fresh;
    BlasResult made = make_blas(alone, options, pool, cancel);
    return BuiltTree{std::move(made.blas), made.history};
  };
  blas->deferred = std::make_shared<DeferredTree>(build);
  MeshReport& report = result.report;
  report.mesh_id = changed.mesh_id;
  report.usage = usage_name(state.usage);
  report.expected_rays = changed.rays;
  report.action = MeshAction::kDeferred;
  report.reason = why_deferred(state.blas == nullptr, state.same_topology, blas->mesh.kind);
  report.builder = builder_name(blas->config.builder);
  report.layout = layout_name(blas->config.layout);
  report.kind = kind_name(blas->mesh.kind);
  report.triangle_count = blas->mesh.primitive_count();
  report.byte_count = blas->mesh.byte_count();
  report.milliseconds = watch.milliseconds();
  result.blas = std::move(blas);
  return result;
}

bool adopt_built_tree(MeshState& state) {
  if (!state.blas || !state.blas->deferred) return false;
  BuiltTree built = state.blas->deferred->if_built();
  if (!built.blas) return false;
  state.blas = std::move(built.blas);
  state.history = built.history;
  return true;
}

}  // namespace perfect_bvh
