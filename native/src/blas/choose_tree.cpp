#include "blas/choose_tree.h"

#include <array>
#include <limits>
#include <span>
#include <utility>

#include "blas/build_tree.h"
#include "blas/ledger.h"
#include "update/mesh_shape.h"

namespace perfect_bvh {
namespace {

// How many commits a tree is expected to serve: one of a still mesh serves a whole animation, or a single picture.
constexpr double kStaticCommits = 4;

// References added where rays repay spatial splits, as a share of the triangles. Copies are made only where they lower
// the cost: next to none of leaves and statues, a few of gear wheels, all of them of sticks and hair, whose trees then
// take up to 3.5 times the bytes.
constexpr float kAmpleBudget = 5.0f;

// From the one that is built soonest to the one whose rays cost least.
constexpr std::array kByQuality{BuilderKind::kFast, BuilderKind::kBinned, BuilderKind::kSpatial};

// Those that will do for a mesh of this kind. A tree with spatial splits cannot be refitted, and takes long to build.
std::span<const BuilderKind> builders_for(Usage usage) noexcept {
  const std::span<const BuilderKind> all(kByQuality);
  if (usage == Usage::kStatic) return all;
  return usage == Usage::kDeforming ? all.subspan(1, 1) : all.first(2);
}

// From `least` on; empty if that is not among them.
std::span<const BuilderKind> builders_from(BuilderKind least, Usage usage) noexcept {
  const std::span<const BuilderKind> all = builders_for(usage);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] == least) return all.subspan(i);
  }
  return {};
}

bool is_free(const MeshState& state, const CommitOptions& options) noexcept {
  return state.config.builder == BuilderKind::kAuto && options.policy == Policy::kGoverned;
}

bool was_budgeted(const BuildConfig& config) noexcept {
  return config.duplication_budget != BuildConfig().duplication_budget;
}

}  // namespace

double rays_to_come(Usage usage, double rays) noexcept {
  return usage == Usage::kStatic ? rays * kStaticCommits : rays;
}

TreeChoice choose_tree(const ChangedMesh& changed, const CommitOptions& options, CancelToken& cancel) {
  const MeshState& state = *changed.state;
  const Usage usage = usage_of(state.usage, state.has_deformed);
  TreeChoice choice{choose_builder(state.config, usage), {}};
  const double known = changed.rays.value_or(changed.cast_rays);
  if (!is_free(state, options) || !(changed.rays || known > 0)) return choice;
  const bool replaces = is_resting(state) && !state.has_deformed;
  const Mesh& mesh = is_resting(state) ? state.blas->mesh : *state.edited;
  BuildQuestion question{builders_for(usage), mesh.primitive_count(), changed.served_rays + rays_to_come(usage, known),
                         0, std::nullopt};
  if (replaces) {
    question.held = state.blas->config.builder;
    question.builders = builders_from(*question.held, usage);
  } else if (!changed.rays) {
    question.builders = builders_from(choice.config.builder, usage);
    if (question.builders.size() < 2) return choice;
  }
  if (question.builders.back() == BuilderKind::kSpatial) {
    question.air = is_resting(state) && state.air ? *state.air : measure_air(mesh, cancel);
  }
  BuildDecision decision = decide_build(question, options.calibration);
  choice.alternatives = std::move(decision.alternatives);
  if (decision.builder == BuilderKind::kBinned) {
    choice.config = choose_builder(state.config, Usage::kStatic);
  } else {
    choice.config = state.config;
    choice.config.builder = decision.builder;
    const bool is_ample = decision.builder == BuilderKind::kSpatial && !was_budgeted(state.config);
    if (is_ample) choice.config.duplication_budget = kAmpleBudget;
  }
  return choice;
}

double most_rays_of_tree(const MeshState& state, const CommitOptions& options) noexcept {
  constexpr double kNoMatter = std::numeric_limits<double>::infinity();
  if (!is_resting(state) || state.has_deformed || !is_free(state, options)) return kNoMatter;
  const BuilderKind held = state.blas->config.builder;
  const auto builders = builders_from(held, state.usage);
  if (builders.size() < 2) return kNoMatter;
  const double air = state.air.value_or(kNoMatter);
  return repaying_rays({builders, state.blas->mesh.primitive_count(), 0, air, held}, options.calibration);
}

}  // namespace perfect_bvh
