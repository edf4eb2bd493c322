#include "sway_race.h"

#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "blas/build_tree.h"
#include "embree_refit.h"
#include "json.h"
#include "mesh_motions.h"
#include "scene/scene.h"
#include "wide/collapse.h"
#include "wide/wide_refit.h"

namespace perfect_bvh::bench {
namespace {

struct Competitor {
  std::string method;
  std::function<double(const Positions&)> move;                // seconds
  std::function<void()> start_count = [] {};                   // called when the counted rounds begin
  std::function<void(JsonObject&)> tell = [](JsonObject&) {};  // adds statistics of those rounds
  std::vector<double> nanoseconds{};                           // per triangle, for each round
};

// Refits only the tree, into the memory of a former tree of the same shape, as a scene does after some frames.
Competitor our_refit(const Mesh& mesh, int thread_count) {
  struct State {
    Mesh mesh;
    ThreadPool pool;
    WideBvh trees[2];
    RefitPlan plan;
    std::size_t now;
  };
  const std::shared_ptr<State> state(new State{mesh, ThreadPool(thread_count), {}, {}, 0});
  CancelToken cancel;
  const Bvh2 tree = build_tree(mesh, choose_builder({}, Usage::kDeforming), state->pool, cancel);
  for (WideBvh& wide : state->trees) wide = collapse_mesh(tree, mesh, state->pool, cancel);
  complete_plan(state->plan, state->trees[0], mesh, state->pool, cancel);
  const auto move = [state, thread_count](const Positions& positions) {
    CancelToken token;
    state->mesh.positions = positions;
    const WideBvh& from = state->trees[state->now];
    state->now = 1 - state->now;
    const double start = seconds(thread_count);
    static_cast<void>(refit_wide(from, state->plan, state->mesh, state->trees[state->now], true, state->pool, token));
    return seconds(thread_count) - start;
  };
  return {"refit", move};
}

const char* name_of(MeshAction action) {
  switch (action) {
    case MeshAction::kRefitted:
      return "refitted";
    case MeshAction::kRotated:
      return "rotated";
    case MeshAction::kPartlyRebuilt:
      return "partly rebuilt";
    case MeshAction::kRebuilt:
      return "rebuilt";
    default:
      return "other";
  }
}

// Times a whole commit, including the copy of the positions; the governor decides how to update.
Competitor our_commit(const Mesh& mesh, int thread_count) {
  struct State {
    ThreadPool pool;
    Scene scene;
    std::int32_t mesh_id = 0;
    std::map<std::string, int> actions;
    explicit State(int threads) : pool(threads) {}
  };
  const auto state = std::make_shared<State>(thread_count);
  CancelToken cancel;
  state->mesh_id = state->scene.add_mesh(Mesh(mesh), {}, Usage::kDeforming);
  state->scene.add_instances(std::vector<InstanceInput>{{state->mesh_id, Affine{}, ~0u, std::nullopt}});
  static_cast<void>(state->scene.commit(state->pool, cancel));
  const auto move = [state, thread_count](const Positions& positions) {
    CancelToken token;
    const double start = seconds(thread_count);
    state->scene.update_mesh<float>(state->mesh_id, positions);
    const CommitReport report = state->scene.commit(state->pool, token);
    const double taken = seconds(thread_count) - start;
    ++state->actions[name_of(report.meshes.at(0).action)];
    return taken;
  };
  const auto tell = [state](JsonObject& row) {
    JsonObject actions;
    for (const auto& [name, count] : state->actions) actions.add(name.c_str(), count);
    row.add_raw("actions", actions.text());
  };
  return {"commit", move, [state] { state->actions.clear(); }, tell};
}

Competitor embree_refit(const Mesh& mesh, int thread_count) {
  const auto peer = std::make_shared<EmbreeRefit>(mesh, thread_count);
  return {"embree refit", [peer](const Positions& positions) { return peer->move(positions); }};
}

std::string row_of(const Competitor& competitor) {
  const Spread spread = Spread::of(competitor.nanoseconds);
  JsonObject row;
  row.add("method", competitor.method).add("ns_per_triangle", spread.median);
  row.add("ns_low", spread.low).add("ns_high", spread.high);
  competitor.tell(row);
  return row.text();
}

}  // namespace

std::vector<std::string> race_sway(const Mesh& mesh, const RefitOptions& options) {
  std::vector<Competitor> competitors{our_refit(mesh, options.threads), our_commit(mesh, options.threads),
                                      embree_refit(mesh, options.threads)};
  constexpr int kWarmUp = 3;  // rounds that allocate the memory
  for (int round = 0; round < kWarmUp + options.rounds; ++round) {
    const Positions positions = swayed(mesh.positions, round);
    for (std::size_t turn = 0; turn < competitors.size(); ++turn) {
      Competitor& competitor = competitors[(turn + static_cast<std::size_t>(round)) % competitors.size()];
      if (round == kWarmUp) competitor.start_count();
      const double taken = competitor.move(positions);
      if (round < kWarmUp) continue;
      competitor.nanoseconds.push_back(1e9 * taken / static_cast<double>(mesh.primitive_count()));
    }
  }
  std::vector<std::string> rows;
  for (const Competitor& competitor : competitors) rows.push_back(row_of(competitor));
  return rows;
}

}  // namespace perfect_bvh::bench
