#include "twist_race.h"

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "answer_judge.h"
#include "blas/build_tree.h"
#include "embree_build.h"
#include "embree_peer.h"
#include "embree_rays.h"
#include "embree_refit.h"
#include "json.h"
#include "mesh_motions.h"
#include "our_rays.h"
#include "ray_race.h"
#include "tree_scene.h"
#include "wide/collapse.h"
#include "wide/fast_wide.h"
#include "wide/wide_cost.h"
#include "wide/wide_rebuild.h"
#include "wide/wide_refit.h"

namespace perfect_bvh::bench {
namespace {

// The result of one method that updates the tree of the mesh at rest to the twisted mesh.
struct Update {
  std::string method;
  bool is_ours = true;
  double ns_per_triangle = 0;
  std::optional<double> cost;
  RayCompetitor traced;
  std::size_t rebuilt = 0;  // index in all updates of the one it is compared with
};

class Twist {
 public:
  Twist(const Mesh& rest, std::shared_ptr<const Mesh> mesh, const RefitOptions& options)
      : rest_(rest), mesh_(std::move(mesh)), threads_(options.threads), pool_(options.threads) {}

  // The new tree comes first.
  void add_ours() {
    const BuildConfig config = choose_builder({}, Usage::kDeforming);
    rebuilt_ = updates_.size();
    add("rebuild", {}, [&](WideBvh& wide, WideCosts& costs) {
      wide = collapse_mesh(build_tree(*mesh_, config, pool_, cancel_), *mesh_, pool_, cancel_);
      costs = measure_wide_costs(wide, pool_, cancel_);
    });
    add("fast rebuild", {}, [&](WideBvh& wide, WideCosts& costs) {
      wide = build_fast_wide(*mesh_, pool_, cancel_);
      costs = measure_wide_costs(wide, pool_, cancel_);
    });
    const WideBvh still = collapse_mesh(build_tree(rest_, config, pool_, cancel_), rest_, pool_, cancel_);
    const WideCosts fresh = measure_wide_costs(still, pool_, cancel_);
    RefitPlan plan;
    complete_plan(plan, still, rest_, pool_, cancel_);
    const auto refit = [&](WideBvh& wide, WideCosts& costs) {
      costs = refit_wide(still, plan, *mesh_, wide, true, pool_, cancel_);
    };
    const auto rebuild_degraded = [&](double tolerance) {
      return [&, tolerance](WideBvh& wide, WideCosts& costs) {
        refit(wide, costs);
        WideCosts compared = fresh;
        const auto parts = find_degraded_parts(wide, costs, compared, tolerance, cancel_);
        costs = rebuild_parts(wide, compared, parts, config, pool_, cancel_);
      };
    };
    add("refit", still, refit);
    add("rotations", still, [&](WideBvh& wide, WideCosts& costs) {
      refit(wide, costs);
      static_cast<void>(rotate_wide(wide, costs, pool_, cancel_));
    });
    add("partial rebuild", still, rebuild_degraded(1.1));
    add("rebuild over its leaves", still, rebuild_degraded(0.0));
  }

  void add_embree() {
    rebuilt_ = updates_.size();
    EmbreeBuilder builder(RTC_BUILD_QUALITY_MEDIUM, threads_);
    const double built = ns_per_triangle([&] { return builder.build(*mesh_); });
    EmbreePeer::Options options;
    options.device = "threads=" + std::to_string(threads_);
    const auto rebuilt = std::make_shared<const EmbreePeer>(*mesh_, options);
    updates_.push_back({"embree rebuild", false, built, {}, embree_competitor("embree rebuild", rebuilt), rebuilt_});
    const auto refitted = std::make_shared<EmbreeRefit>(rest_, threads_);
    const double moved = ns_per_triangle([&] {
      static_cast<void>(refitted->move(rest_.positions));
      return refitted->move(mesh_->positions);
    });
    const RayCompetitor traced{"embree refit", std::make_shared<EmbreeRays>(refitted, refitted->scene())};
    updates_.push_back({"embree refit", false, moved, {}, traced, rebuilt_});
  }

  [[nodiscard]] const std::vector<Update>& updates() const noexcept { return updates_; }
  [[nodiscard]] const std::shared_ptr<const Snapshot>& scene() const noexcept { return first_; }

 private:
  // When make(wide, costs) is called, `wide` is a copy of `still`.
  void add(const std::string& method, const WideBvh& still, const std::function<void(WideBvh&, WideCosts&)>& make) {
    WideBvh wide;
    WideCosts costs;
    const double taken = ns_per_triangle([&] {
      wide = still;
      const double start = seconds(threads_);
      make(wide, costs);
      return seconds(threads_) - start;
    });
    const double cost = costs.whole(wide);
    const auto snapshot = snapshot_over(mesh_, std::move(wide));
    if (!first_) first_ = snapshot;
    const RayCompetitor traced{method, std::make_shared<OurRays>(snapshot)};
    updates_.push_back({method, true, taken, cost, traced, rebuilt_});
  }

  // update() returns seconds. It is run several times, for both engines, and the median counts.
  [[nodiscard]] double ns_per_triangle(const std::function<double()>& update) const {
    const std::size_t repeats = mesh_->primitive_count() > 1'000'000 ? 1 : 3;
    std::vector<double> taken(repeats);
    for (double& each : taken) each = update();
    return 1e9 * Spread::of(taken).median / static_cast<double>(mesh_->primitive_count());
  }

  const Mesh& rest_;
  const std::shared_ptr<const Mesh> mesh_;
  const int threads_;
  ThreadPool pool_;
  CancelToken cancel_;
  std::vector<Update> updates_;
  std::size_t rebuilt_ = 0;
  std::shared_ptr<const Snapshot> first_;
};

// Results of one update, over the kinds of rays.
struct Traced {
  double seconds = 0;  // of all rays together
  std::vector<std::pair<std::string, double>> mrays_per_second;
  std::size_t judged = 0, wrong = 0, different = 0;
};

std::size_t count_different(const Answers& answers, const Answers& expected) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < answers.t.size(); ++i) {
    count += answers.t[i] != expected.t[i] || answers.triangles[i] != expected.triangles[i] ? 1 : 0;
  }
  return count;
}

void trace_set(const RaySet& set, const Twist& twist, int rounds, std::vector<Traced>& traced) {
  std::vector<RayCompetitor> competitors;
  for (const Update& update : twist.updates()) competitors.push_back(update.traced);
  const std::vector<RaceResult> results = race(set, competitors, {rounds, kBatch, 0.0});
  AnswerJudge judge(twist.scene(), set.rays);
  const Answers expected = answers_of(competitors.front(), set.rays);
  for (std::size_t i = 0; i < competitors.size(); ++i) {
    Traced& each = traced[i];
    each.mrays_per_second.emplace_back(set.name, results[i].mrays_per_second);
    each.seconds += 1e-6 * static_cast<double>(set.rays.size()) / results[i].mrays_per_second;
    each.judged += judge.ray_count();
    each.wrong += judge.count_wrong(competitors[i]);
    each.different += count_different(answers_of(competitors[i], set.rays), expected);
  }
}

std::string row_of(const Update& update, const Traced& traced, const Traced& rebuilt, float radians) {
  JsonObject row;
  row.add("twist", static_cast<double>(radians)).add("method", update.method);
  row.add("ns_per_triangle", update.ns_per_triangle).add("cost", update.cost);
  row.add("rays_per_second_ratio", rebuilt.seconds / traced.seconds);
  for (std::size_t i = 0; i < traced.mrays_per_second.size(); ++i) {
    const auto& [kind, rate] = traced.mrays_per_second[i];
    row.add((kind + "_ratio").c_str(), rate / rebuilt.mrays_per_second[i].second);
  }
  row.add("judged", traced.judged).add("wrong", traced.wrong);
  if (update.is_ours) row.add("different", traced.different);
  return row.text();
}

}  // namespace

std::vector<std::string> race_twist(const Mesh& rest, float radians, const RefitOptions& options) {
  const auto mesh = std::make_shared<const Mesh>(with(rest, twisted(rest.positions, radians)));
  Twist twist(rest, mesh, options);
  twist.add_ours();
  twist.add_embree();
  const std::vector<Update>& updates = twist.updates();
  std::vector<Traced> traced(updates.size());
  const Aabb box = bounds_of_positions(mesh->positions);
  const std::vector<Ray> primary = primary_rays(box, View::kOutside, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  updates.front().traced.caster->answer(primary, {false, true}, std::span(hits));
  for (const RaySet& set : make_ray_sets(*mesh, box, View::kOutside, primary, hits)) {
    if ((set.name != "primary" && set.name != "diffuse") || set.rays.empty()) continue;
    trace_set(set, twist, options.ray_rounds, traced);
  }
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < updates.size(); ++i) {
    rows.push_back(row_of(updates[i], traced[i], traced[updates[i].rebuilt], radians));
  }
  return rows;
}

}  // namespace perfect_bvh::bench
