// instance_bench [options] MESH.bin
//   --counts a,b     instances (1000,10000,100000)       --layouts a,b      of grid,heap (both)
//   --threads N      of both sides, for commits (1)      --rounds N         interleaved rounds (5)
//   --kinds a,b      of first,commit,primary,diffuse (all)
//   --peers a,b      of embree,low,array,array_low (embree,low,array): see instance_scene.h; rays are cast at the first
// --strategies a,b of auto,packets,stream,single (auto): how our rays are traced
//   --size WxH       of the image (640x400)              --json OUT.json
// --noisy          measure at any load
//
// The mesh's own tree, and the transforms in each engine's format, are ready before timing starts. First: all instances
// are added to an empty scene and committed, each time in a new process. Commits: every instance gets another
// transform, then the scene is committed. Competitors take turns; results are medians of the rounds. With one thread
// the time is the thread's own CPU time, otherwise wall-clock time.
// Rays: see ray_race.h; ratios are to the first peer. The nodes and triangles that our rays visit are counted in
// another run.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <stdexcept>

#include "arguments.h"
#include "instance_layouts.h"
#include "json.h"
#include "mesh_motions.h"
#include "our_instances.h"
#include "our_rays.h"
#include "own_process.h"
#include "program.h"
#include "query/trace.h"
#include "ray_race.h"
#include "ray_sets.h"
#include "ways.h"

namespace perfect_bvh::bench {
namespace {

struct Options : CommonOptions {
  std::vector<std::string> layouts{"grid", "heap"}, kinds{"first", "commit", "primary", "diffuse"};
  std::vector<std::string> peers{"embree", "low", "array"}, strategies{"auto"};
  std::vector<std::size_t> counts{1000, 10000, 100000};
  int threads = 1;
  std::string mesh;

  [[nodiscard]] bool wants(const char* kind) const {
    return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  }
};

void set(Options& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (set_common(options, arguments)) return;
  if (name == "--counts") {
    options.counts.clear();
    for (const std::string& part : arguments.list()) options.counts.push_back(std::stoul(part));
  } else if (name == "--layouts") {
    options.layouts = arguments.list();
  } else if (name == "--kinds") {
    options.kinds = arguments.list();
  } else if (name == "--peers") {
    options.peers = arguments.list();
  } else if (name == "--strategies") {
    options.strategies = arguments.list();
  } else if (name == "--threads") {
    options.threads = std::stoi(arguments.value());
  } else {
    options.mesh = arguments.path();
  }
}

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) set(options, arguments);
  if (options.mesh.empty()) throw std::runtime_error("instance_bench: no mesh given");
  if (options.peers.empty()) throw std::runtime_error("instance_bench: no peer given");
  return options;
}

// A layout with `count` instances.
struct Crowd {
  std::string layout;
  std::size_t count;

  [[nodiscard]] std::vector<Affine> place(const Mesh& mesh, unsigned seed) const {
    return place_instances(layout, bounds_of_positions(mesh.positions), count, seed);
  }
  [[nodiscard]] JsonObject row(const std::string& kind, const std::string& competitor) const {
    JsonObject row;
    return row.add("layout", layout).add("instances", count).add("kind", kind).add("competitor", competitor);
  }
};

constexpr const char* kOurs = "ours";

std::unique_ptr<InstanceScene> make_scene(const std::string& name, const Mesh& mesh, int threads) {
  if (name == kOurs) return std::make_unique<OurInstances>(mesh, threads);
  return make_embree_instances(name, mesh, threads);
}

// Builds and updates -----------------------------------------------------------------------------------------------

struct Times {
  std::vector<double> set, commit;  // seconds
  TopLevelReport stages;            // ours: of the last commit
};

// Times handing over and committing the prepared instances. hand_over: add or move.
std::vector<double> time_commit(InstanceScene& scene, void (InstanceScene::*hand_over)(), int threads) {
  const double start = seconds(threads);
  (scene.*hand_over)();
  const double middle = seconds(threads);
  scene.commit();
  return {middle - start, seconds(threads) - middle};
}

// A process hands back only numbers.
void add_stages(const OurInstances& ours, std::vector<double>& figures) {
  const TopLevelReport& top = ours.report().top_level;
  figures.insert(figures.end(), {top.placing_milliseconds, top.build_milliseconds, top.clustering_milliseconds,
                                 top.collapse_milliseconds});
}

std::vector<Times> time_first(const std::vector<std::string>& names, const Mesh& mesh, const Crowd& crowd,
                              const Options& options) {
  const std::vector<Affine> placed = crowd.place(mesh, 1);
  std::vector<Times> times(names.size());
  // An unmeasured round first: memory that a virtual machine touches for the first time takes its host ten times as
  // long.
  for (int round = -1; round < options.rounds; ++round) {
    for (std::size_t turn = 0; turn < names.size(); ++turn) {
      const std::size_t who = (turn + static_cast<std::size_t>(round + 1)) % names.size();
      const std::vector<double> each = run_in_own_process([&] {
        const auto scene = make_scene(names[who], mesh, options.threads);
        scene->prepare(placed);
        std::vector<double> figures = time_commit(*scene, &InstanceScene::add, options.threads);
        if (const auto* ours = dynamic_cast<const OurInstances*>(scene.get())) add_stages(*ours, figures);
        return figures;
      });
      if (round < 0) continue;
      times[who].set.push_back(each.at(0)), times[who].commit.push_back(each.at(1));
      if (each.size() == 2) continue;
      TopLevelReport& stages = times[who].stages;
      stages.placing_milliseconds = each.at(2), stages.build_milliseconds = each.at(3);
      stages.clustering_milliseconds = each.at(4), stages.collapse_milliseconds = each.at(5);
    }
  }
  return times;
}

using Scenes = std::vector<std::unique_ptr<InstanceScene>>;

// Afterwards all instances are back where time_first() placed them.
std::vector<Times> time_updates(const Scenes& scenes, const Mesh& mesh, const Crowd& crowd, const Options& options) {
  const std::vector<Affine> placed[2] = {crowd.place(mesh, 2), crowd.place(mesh, 3)};
  std::vector<Times> times(scenes.size());
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t turn = 0; turn < scenes.size(); ++turn) {
      const std::size_t who = (turn + static_cast<std::size_t>(round)) % scenes.size();
      scenes[who]->prepare(placed[round % 2]);
      const std::vector<double> each = time_commit(*scenes[who], &InstanceScene::move, options.threads);
      times[who].set.push_back(each.at(0)), times[who].commit.push_back(each.at(1));
    }
  }
  const std::vector<Affine> rest = crowd.place(mesh, 1);
  for (const auto& scene : scenes) scene->prepare(rest), scene->move(), scene->commit();
  return times;
}

void report_times(const Crowd& crowd, const std::string& kind, const std::vector<std::string>& names,
                  const std::vector<Times>& times, int threads, std::vector<std::string>& rows) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double set = 1e3 * Spread::of(times[i].set).median, commit = 1e3 * Spread::of(times[i].commit).median;
    std::printf("%-5s %8zu %-7s %-10s set %8.2f ms, commit %8.2f ms, %6.0f ns an instance in all\n",
                crowd.layout.c_str(), crowd.count, kind.c_str(), names[i].c_str(), set, commit,
                1e6 * (set + commit) / static_cast<double>(crowd.count));
    JsonObject row = crowd.row(kind, names[i]);
    rows.push_back(row.add("threads", threads).add("set_ms", set).add("commit_ms", commit).text());
  }
  std::fflush(stdout);
}

void report_stages(const Crowd& crowd, const char* commit, const TopLevelReport& top, std::vector<std::string>& rows) {
  std::printf("      ours: placing %.2f, refit %.2f, build %.2f, clustering %.2f, collapse %.2f ms (%s; %s)\n",
              top.placing_milliseconds, top.refit_milliseconds, top.build_milliseconds, top.clustering_milliseconds,
              top.collapse_milliseconds, top.builder.c_str(), top.reason.c_str());
  JsonObject row = crowd.row("stages", kOurs);
  row.add("commit", commit);
  row.add("placing_ms", top.placing_milliseconds).add("refit_ms", top.refit_milliseconds);
  row.add("build_ms", top.build_milliseconds).add("clustering_ms", top.clustering_milliseconds);
  rows.push_back(row.add("collapse_ms", top.collapse_milliseconds).text());
}

// Rays -------------------------------------------------------------------------------------------------------------

std::vector<Ray> bounces(const Snapshot& snapshot, const std::vector<Ray>& primary, double diagonal) {
  std::vector<Hit> hits(primary.size());
  trace_closest(snapshot, primary, hits);
  std::vector<Ray> result;
  std::mt19937 random(5);
  for (std::size_t i = 0; i < primary.size(); ++i) {
    if (!hits[i].found()) continue;
    Vec3d normal = world_triangle(snapshot, hits[i]).scaled_normal();
    const double length = std::sqrt(dot(normal, normal));
    if (!(length > 0)) continue;
    normal = normal * (1.0 / length);
    if (dot(normal, primary[i].direction) > 0) normal = -normal;
    const Vec3d origin = hit_position(snapshot, hits[i]) + normal * (1e-4 * diagonal);
    result.push_back(diffuse_ray(origin, normal, random));
  }
  return result;
}

void report_rays(const Crowd& crowd, const RaySet& set, const std::vector<RayCompetitor>& competitors,
                 const std::vector<RaceResult>& results, std::vector<std::string>& rows) {
  std::printf("%-5s %8zu %-8s", crowd.layout.c_str(), crowd.count, set.name.c_str());
  for (std::size_t i = 0; i < competitors.size(); ++i) {
    const RaceResult& result = results[i];
    const double ratio = result.mrays_per_second / results.front().mrays_per_second;
    std::printf(" %s %.3f M/s (%.3f, %zu, %zu)", competitors[i].name.c_str(), result.mrays_per_second, ratio,
                result.agreement.different, result.agreement.other_triangle);
    JsonObject row = crowd.row(set.name, competitors[i].name);
    row.add("mrays_per_second", result.mrays_per_second).add("ratio", ratio).add("rounds", result.rounds);
    row.add("different_from_first", result.agreement.different);
    row.add("other_triangle_than_first", result.agreement.other_triangle);
    rows.push_back(row.add("ray_count", set.rays.size()).text());
  }
}

void race_rays(const Crowd& crowd, const InstanceScene& peer, const OurInstances& ours, const Options& options,
               std::vector<std::string>& rows) {
  const auto snapshot = ours.snapshot();
  const Aabb world = snapshot->bounds;
  std::vector<RayCompetitor> competitors{{options.peers.front(), peer.caster()}};
  for (const std::string& name : options.strategies) {
    const TraceOptions way{parse_strategy(name), 0};
    competitors.push_back({name == "auto" ? kOurs : "ours/" + name, std::make_shared<OurRays>(snapshot, "", way)});
  }
  const auto diagonal = static_cast<double>(length(world.extent()));
  const std::vector<Ray> primary = primary_rays(world, View::kOutside, options.width, options.height);
  for (const char* kind : {"primary", "diffuse"}) {
    if (!options.wants(kind)) continue;
    const bool is_primary = std::string(kind) == "primary";
    const RaySet set{kind, {false, is_primary}, is_primary ? primary : bounces(*snapshot, primary, diagonal)};
    report_rays(crowd, set, competitors, race(set, competitors, {options.rounds, kBatch, diagonal}), rows);
    const Visits visits = count_visits(*snapshot, set);
    std::printf("  ours: %.2f nodes, %.2f triangles a ray\n", visits.nodes, visits.triangles);
    std::fflush(stdout);
  }
}

// ------------------------------------------------------------------------------------------------------------------

void bench_crowd(const Mesh& mesh, const Crowd& crowd, const std::vector<std::string>& names, const Options& options,
                 std::vector<std::string>& rows) {
  const std::vector<Affine> placed = crowd.place(mesh, 1);
  Scenes scenes;
  for (const std::string& name : names) {
    scenes.push_back(make_scene(name, mesh, options.threads));
    scenes.back()->prepare(placed), scenes.back()->add(), scenes.back()->commit();
  }
  const auto& ours = dynamic_cast<const OurInstances&>(*scenes.back());
  if (options.wants("commit")) {
    report_times(crowd, "commit", names, time_updates(scenes, mesh, crowd, options), options.threads, rows);
    report_stages(crowd, "commit", ours.report().top_level, rows);
  }
  if (options.wants("primary") || options.wants("diffuse")) race_rays(crowd, *scenes.front(), ours, options, rows);
}

std::string bench(const Options& options) {
  const Mesh mesh = read_mesh(options.mesh);
  std::vector<std::string> names = options.peers, rows;
  names.push_back(kOurs);
  std::vector<Crowd> crowds;
  for (const std::string& layout : options.layouts) {
    for (const std::size_t count : options.counts) crowds.push_back({layout, count});
  }
  // All first builds come first: each runs in a fork of this process, which has not started threads yet.
  for (const Crowd& crowd : crowds) {
    if (!options.wants("first")) break;
    const std::vector<Times> times = time_first(names, mesh, crowd, options);
    report_times(crowd, "first", names, times, options.threads, rows);
    report_stages(crowd, "first", times.back().stages, rows);
  }
  for (const Crowd& crowd : crowds) bench_crowd(mesh, crowd, names, options, rows);
  return options.json.empty() ? "" : to_json(rows);
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
