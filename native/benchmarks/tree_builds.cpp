#include "tree_builds.h"

#include <algorithm>
#include <optional>

#include "embree_build.h"
#include "own_process.h"
#include "scene/scene.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {
namespace {

std::vector<double> commit_timed(const TreeChoice& choice, const Mesh& mesh, int thread_count) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  Scene scene;
  const std::int32_t mesh_id = scene.add_mesh(mesh, choice.config, choice.usage);
  scene.add_instances(std::vector<InstanceInput>{{mesh_id, Affine{}, ~0u, std::nullopt}});
  const double start = seconds(thread_count);
  const CommitReport report = scene.commit(pool, cancel);
  const double taken = seconds(thread_count) - start;
  const MeshReport& built = report.meshes.front();
  return {1e3 * taken, built.build_milliseconds, built.optimize_milliseconds, built.collapse_milliseconds,
          report.top_level_milliseconds};
}

std::vector<double> build_binary_timed(const TreeChoice& choice, const Mesh& mesh, int thread_count) {
  ThreadPool pool(thread_count);
  CancelToken cancel;
  const BuildConfig config = choose_builder(choice.config, choice.usage);
  const double start = seconds(thread_count);
  static_cast<void>(build_tree(mesh, config, pool, cancel));
  return {1e3 * (seconds(thread_count) - start)};
}

void add_times(Builder& builder, bool is_cold) {
  const auto run = [&](const auto& work) { return is_cold ? run_in_own_process(work) : work(); };
  const std::vector<double> ready = run(builder.ready);
  builder.ready_ms.push_back(ready.at(0));
  if (!builder.is_ours()) {
    builder.byte_count = static_cast<std::size_t>(ready.at(1));
    return;
  }
  builder.stage_ms.resize(std::size(kStages));
  for (std::size_t i = 0; i < std::size(kStages); ++i) builder.stage_ms[i].push_back(ready.at(1 + i));
  builder.build_ms.push_back(run(builder.binary).at(0));
}

}  // namespace

Builder our_builder(const TreeChoice& choice, const Mesh& mesh, int thread_count) {
  Builder builder;
  builder.name = choice.name;
  builder.ready = [=, &mesh] { return commit_timed(choice, mesh, thread_count); };
  builder.binary = [=, &mesh] { return build_binary_timed(choice, mesh, thread_count); };
  return builder;
}

Builder embree_builder(const std::string& peer, const Mesh& mesh, int thread_count) {
  Builder builder;
  builder.name = peer;
  builder.ready = [quality = embree_quality(peer), &mesh, thread_count]() -> std::vector<double> {
    EmbreeBuilder embree(quality, thread_count);
    const double taken = embree.build(mesh);
    return {1e3 * taken, static_cast<double>(embree.byte_count())};
  };
  return builder;
}

void race_builds(std::vector<Builder>& builders, const BuildRace& race) {
  const double start = seconds_on(CLOCK_MONOTONIC);
  for (int round = 0;; ++round) {
    const double gone = seconds_on(CLOCK_MONOTONIC) - start;
    if (round > 0 && gone > race.seconds) break;
    if (round >= race.rounds && gone > race.least_seconds) break;
    for (std::size_t turn = 0; turn < builders.size(); ++turn) {
      add_times(builders[(turn + static_cast<std::size_t>(round)) % builders.size()], race.is_cold);
      const double turns = static_cast<double>(turn + 1) / static_cast<double>(builders.size());
      race.tell(std::min((round + turns) / race.rounds, 1.0));
    }
  }
}

}  // namespace perfect_bvh::bench
