// Where the shapes that a mesh will take are known: whether one tree for all of them pays, and that tree. It is built
// over the shape in the middle, improved for all shapes (builders/animated.h), collapsed, and refitted to where the
// mesh is now; later commits refit it, as long as it costs no more than was foreseen.

#include <algorithm>
#include <vector>

#include "blas/build_tree.h"
#include "blas/ledger.h"
#include "blas/make_blas.h"
#include "builders/animated.h"
#include "core/stopwatch.h"
#include "update/animation.h"
#include "update/mesh_shape.h"
#include "wide/collapse.h"
#include "wide/wide_boxes.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {
namespace {

// The last of them looks at nearly all nodes; three more gained 1 to 3 percent on most meshes, for half the time again.
constexpr std::uint32_t kPasses = 6;

// Of the shapes that the tree is optimised for.
class ShapeBoxes final : public SampledBoxes {
 public:
  explicit ShapeBoxes(const Mesh& shapes) {
    const std::size_t last = shapes.later.size(), count = std::min(last + 1, kMostShapesBuiltFor);
    for (std::size_t i = 0; i < count; ++i) {
      shapes_.push_back(&shapes.at_step(static_cast<std::uint32_t>(i * last / (count - 1))));
    }
  }
  [[nodiscard]] std::size_t sample_count() const noexcept override { return shapes_.size(); }
  [[nodiscard]] Aabb box(std::size_t sample, std::uint32_t prim_index) const noexcept override {
    return shapes_[sample]->primitive_box(prim_index);
  }

 private:
  std::vector<const Mesh*> shapes_;
};

bool is_due(const ChangedMesh& changed, const CommitOptions& options, const Blas& blas) noexcept {
  const MeshState& state = *changed.state;
  const bool governs = options.policy == Policy::kGoverned && changed.rays.value_or(0) > 0;
  return state.animation && !is_resting(state) && (governs || options.policy == Policy::kAnimate) &&
         !blas.wide.is_empty && is_refittable(blas.wide);
}

// What a ray costs in a tree that is refitted to each of the shapes.
std::vector<double> refitted_nanoseconds(const WideBvh& tree, const Mesh& shapes, const Calibration& calibration,
                                         ThreadPool& pool, CancelToken& cancel) {
  RefitPlan plan;
  complete_plan(plan, tree, shapes, pool, cancel);
  WideBvh refitted;
  std::vector<double> costs;
  for (std::uint32_t shape = 0; shape <= shapes.later.size(); ++shape) {
    static_cast<void>(refit_wide(tree, plan, shapes.at_step(shape), refitted, shape > 0, pool, cancel));
    costs.push_back(ray_nanoseconds(measure_trace_work(refitted, shapes.at_step(shape), cancel), calibration));
  }
  return costs;
}

// What one costs in a tree that is built for each of them. `history`: of a tree over the mesh.
std::vector<double> fresh_costs_at(const Mesh& shapes, const UpdateHistory& history, const Calibration& calibration,
                                   ThreadPool& pool, CancelToken& cancel) {
  std::vector<double> costs;
  for (std::uint32_t shape = 0; shape <= shapes.later.size(); ++shape) {
    cancel.checkpoint();
    costs.push_back(fresh_nanoseconds(history, measure_tree_sample(shapes.at_step(shape), pool), calibration));
  }
  return costs;
}

// Over the shape in the middle.
WideBvh build_for_all(const Mesh& shapes, const BuildConfig& config, MeshReport& report, ThreadPool& pool,
                      CancelToken& cancel) {
  Stopwatch watch;
  const Mesh& middle = shapes.at_step(static_cast<std::uint32_t>(shapes.later.size() / 2));
  Bvh2 tree = build_tree(middle, config, pool, cancel);
  report.build_milliseconds += watch.lap_milliseconds();
  static_cast<void>(optimize_over_samples(tree, ShapeBoxes(shapes), kPasses, pool, cancel));
  report.optimize_milliseconds += watch.lap_milliseconds();
  WideBvh wide = collapse_mesh(tree, middle, config.layout, pool, cancel);
  report.collapse_milliseconds += watch.lap_milliseconds();
  return wide;
}

// Leaves end where the builder finds that they should: reinsertion then has more to move than whole leaves of the wide
// tree, and gains up to twice as much.
BuildConfig config_for_all(const MeshState& state) noexcept {
  BuildConfig config = state.config;
  config.builder = BuilderKind::kBinned;
  return config;
}

void take_over(Blas& blas, WideBvh tree, const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  RefitPlan plan;
  complete_plan(plan, tree, blas.mesh, pool, cancel);
  WideBvh refitted;
  static_cast<void>(refit_wide(tree, plan, blas.mesh, refitted, false, pool, cancel));
  blas.wide = std::move(refitted);
  blas.refit_plan = std::move(plan);
  blas.shape = new_tree_shape();
  blas.config = config;
  blas.quality = {};
  blas.fresh_costs.reset();
  blas.built_sah = 0;
  blas.box = mesh_bounds_of(blas.wide, blas.mesh);
}

AnimationQuestion ask(const Blas& blas, const ChangedMesh& changed, const Calibration& calibration,
                      UpdateHistory& history, ThreadPool& pool, CancelToken& cancel) {
  const ExpectedAnimation& animation = *changed.state->animation;
  const Mesh& shapes = *animation.shapes;
  AnimationQuestion question;
  question.triangle_count = blas.mesh.primitive_count();
  question.shape_count = shapes.later.size() + 1;
  question.frame_count = animation.frame_count;
  question.rays = changed.rays.value_or(0);
  question.ray_nanoseconds = ray_nanoseconds(history.now, calibration);
  if (!may_animate(question, calibration)) return question;
  const bool is_new = history.since_build.commit_count == 0;  // built over the shape that the mesh has now
  if (is_new) history.sample = measure_tree_sample(blas.mesh, pool);
  question.refitted = refitted_nanoseconds(blas.wide, shapes, calibration, pool, cancel);
  question.fresh = fresh_costs_at(shapes, history, calibration, pool, cancel);
  return question;
}

// Whether the tree is to be built; notes in the report what that was made of.
bool decide(const AnimationQuestion& question, const CommitOptions& options, MeshReport& report) {
  if (options.policy == Policy::kAnimate) {
    report.reason += "; the policy is to build one tree for all frames always";
    return true;
  }
  const AnimationDecision decision = decide_animation(question, options.calibration);
  note(report, {decision.alternative});
  report.reason += "; " + decision.words;
  return decision.builds;
}

// What was known of fresh trees stays.
void begin_animation(UpdateHistory& history, const TraceWork& work, const Foreseen& foreseen) noexcept {
  history.now = work;
  history.restructured = {};
  history.since_build = history.since_restructuring = history.at_rest = {};
  history.foreseen = foreseen;
}

}  // namespace

void animate_blas(Blas& blas, const ChangedMesh& changed, const CommitOptions& options, BlasResult& result,
                  ThreadPool& pool, CancelToken& cancel) {
  if (!is_due(changed, options, blas)) return;
  const Mesh& shapes = *changed.state->animation->shapes;
  MeshReport& report = result.report;
  result.has_weighed_animation = true;
  const AnimationQuestion question = ask(blas, changed, options.calibration, result.history, pool, cancel);
  if (!decide(question, options, report)) return;
  const BuildConfig config = config_for_all(*changed.state);
  WideBvh tree = build_for_all(shapes, config, report, pool, cancel);
  const std::vector<double> costs = refitted_nanoseconds(tree, shapes, options.calibration, pool, cancel);
  if (options.policy == Policy::kGoverned && !is_cheaper(costs, question.refitted)) {
    report.reason += ", but it was no better";
    return;
  }
  take_over(blas, std::move(tree), config, pool, cancel);
  report.action = MeshAction::kAnimated;
  const TraceWork work = measure_trace_work(blas.wide, blas.mesh, cancel);
  report.node_visits = work.node_visits, report.leaf_visits = work.leaf_visits;
  begin_animation(result.history, work, foresee(costs, question.frame_count));
}

}  // namespace perfect_bvh
