// build_bench [options] MESH.bin
//   --tree NAME:BUILDER[,SETTING=VALUE...]   one of our trees; any number of them
//   --peers a,b      of embree_low, embree_medium, embree_high (all); none: ours alone
//   --threads N      of both sides, for builds (1)       --rounds N         interleaved rounds (5)
//   --seconds S      start no round of builds after that many (60)
//   --ray-rounds N   interleaved rounds of rays; 0: none, and no statistics of the trees (5)
//   --size WxH       of the image that primary rays make (640x400)         --inside  the camera stands inside the box
//   --json OUT.json
//
// Builds: every competitor in turn, the order rotating from round to round, each from a mesh in memory to a scene ready
// to trace; of ours also the binary tree alone. With one thread the time is the thread's own CPU time, otherwise that
// of the wall clock. Rays: see ray_race.h; always on one thread. Prints "progress SHARE" lines.
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <tuple>

#include "arguments.h"
#include "blas/build_tree.h"
#include "embree_build.h"
#include "embree_peer.h"
#include "json.h"
#include "program.h"
#include "query/statistics.h"
#include "query/trace.h"
#include "ray_race.h"
#include "ray_sets.h"
#include "scene/scene.h"
#include "tree_choice.h"

namespace perfect_bvh::bench {
namespace {

struct Options {
  std::vector<TreeChoice> trees;
  std::vector<std::string> peers{"embree_low", "embree_medium", "embree_high"};
  int threads = 1, rounds = 5, ray_rounds = 5;
  double seconds = 60;
  std::uint32_t width = 640, height = 400;
  View view = View::kOutside;
  std::string json, mesh;
};

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) {
    const std::string& name = arguments.name();
    if (name == "--tree") {
      options.trees.push_back(parse_tree(arguments.value()));
    } else if (name == "--peers") {
      options.peers = arguments.list();
    } else if (name == "--threads") {
      options.threads = std::stoi(arguments.value());
    } else if (name == "--rounds") {
      options.rounds = std::stoi(arguments.value());
    } else if (name == "--ray-rounds") {
      options.ray_rounds = std::stoi(arguments.value());
    } else if (name == "--seconds") {
      options.seconds = std::stod(arguments.value());
    } else if (name == "--size") {
      std::tie(options.width, options.height) = arguments.size();
    } else if (name == "--inside") {
      options.view = View::kInside;
    } else if (name == "--json") {
      options.json = arguments.value();
    } else {
      options.mesh = name;
    }
  }
  if (options.mesh.empty()) throw std::runtime_error("build_bench: no mesh given");
  if (options.trees.empty()) options.trees.push_back(parse_tree("auto:auto"));
  return options;
}

RTCBuildQuality quality_of(const std::string& peer) {
  if (peer == "embree_low") return RTC_BUILD_QUALITY_LOW;
  if (peer == "embree_medium") return RTC_BUILD_QUALITY_MEDIUM;
  if (peer == "embree_high") return RTC_BUILD_QUALITY_HIGH;
  throw std::runtime_error("--peers: no peer is called " + peer);
}

// Builds -----------------------------------------------------------------------------------------------------------

// For each engine: times of its binary tree alone (ours) and of all that is needed before a ray.
struct Builder {
  std::string name;
  std::function<void(Builder&)> run;
  std::vector<double> build_ms, ready_ms;
  std::vector<CommitReport> reports;         // ours
  std::size_t byte_count = 0;                // Embree's
  std::shared_ptr<const Snapshot> snapshot;  // ours
};

Builder our_builder(const TreeChoice& choice, const TriangleMesh& mesh, ThreadPool& pool) {
  const auto run = [choice, &mesh, &pool](Builder& self) {
    CancelToken cancel;
    const BuildConfig config = choose_builder(choice.config, Usage::kStatic);
    const double start = seconds(pool.thread_count());
    static_cast<void>(build_tree(mesh, config, pool, cancel));
    self.build_ms.push_back(1e3 * (seconds(pool.thread_count()) - start));
    self.snapshot.reset();
    Scene scene;
    const std::int32_t mesh_id = scene.add_mesh(mesh, choice.config, Usage::kStatic);
    scene.add_instances(std::vector<InstanceInput>{{mesh_id, Affine{}, ~0u, std::nullopt}});
    const double middle = seconds(pool.thread_count());
    self.reports.push_back(scene.commit(pool, cancel));
    self.ready_ms.push_back(1e3 * (seconds(pool.thread_count()) - middle));
    self.snapshot = scene.snapshot();
  };
  return {choice.name, run, {}, {}, {}, 0, nullptr};
}

Builder embree_builder(const std::string& name, const TriangleMesh& mesh, int thread_count) {
  const auto peer = std::make_shared<EmbreeBuilder>(quality_of(name), thread_count);
  const auto run = [peer, &mesh](Builder& self) {
    self.ready_ms.push_back(1e3 * peer->build(mesh));
    self.byte_count = peer->byte_count();
  };
  return {name, run, {}, {}, {}, 0, nullptr};
}

void tell_progress(double share) {
  std::printf("progress %.3f\n", share);
  std::fflush(stdout);
}

// The share of the time that is about right for builds; the rest is for rays.
double build_share(const Options& options) { return options.ray_rounds > 0 ? 0.3 : 1.0; }

void run_builds(std::vector<Builder>& builders, const Options& options) {
  const double start = seconds_on(CLOCK_MONOTONIC);
  for (int round = 0; round < options.rounds; ++round) {
    if (round > 0 && seconds_on(CLOCK_MONOTONIC) - start > options.seconds) break;
    for (std::size_t turn = 0; turn < builders.size(); ++turn) {
      Builder& builder = builders[(turn + static_cast<std::size_t>(round)) % builders.size()];
      builder.run(builder);
      const double turns = static_cast<double>(turn + 1) / static_cast<double>(builders.size());
      tell_progress(build_share(options) * (round + turns) / options.rounds);
    }
  }
}

// Rays -------------------------------------------------------------------------------------------------------------

RayCompetitor competitor_of(const Builder& builder, const TriangleMesh& mesh) {
  if (builder.snapshot) {
    const Snapshot& snapshot = *builder.snapshot;
    return {builder.name,
            [&snapshot](std::span<const Ray> rays, Hit* hits) {
              trace_closest(snapshot, rays, std::span(hits, rays.size()));
            },
            [&snapshot](std::span<const Ray> rays, std::uint8_t* occluded) {
              trace_occluded(snapshot, rays, std::span(occluded, rays.size()));
            }};
  }
  EmbreePeer::Options options;
  options.quality = quality_of(builder.name);
  const auto peer = std::make_shared<EmbreePeer>(mesh, options);
  return {builder.name, [peer](std::span<const Ray> rays, Hit* hits) { peer->closest(rays, hits); },
          [peer](std::span<const Ray> rays, std::uint8_t* occluded) { peer->any(rays, occluded); }};
}

// Visits and tests a ray; empty for peers, who do not tell.
void add_counts(JsonObject& row, const Builder& builder, const RaySet& set) {
  if (!builder.snapshot) return;
  std::vector<RayCounts> counts(set.rays.size());
  if (set.is_any_hit) {
    std::vector<std::uint8_t> occluded(set.rays.size());
    trace_occluded(*builder.snapshot, set.rays, occluded, Cull::kNone, counts);
  } else {
    std::vector<Hit> hits(set.rays.size());
    trace_closest(*builder.snapshot, set.rays, hits, Cull::kNone, counts);
  }
  double nodes = 0, triangles = 0;
  for (const RayCounts& each : counts) nodes += each.nodes_visited, triangles += each.primitives_tested;
  const auto ray_count = static_cast<double>(set.rays.size());
  row.add("nodes_visited", nodes / ray_count).add("primitives_tested", triangles / ray_count);
}

// An object of ray kinds for each builder.
std::vector<std::string> run_rays(const std::vector<Builder>& builders, const TriangleMesh& mesh,
                                  const Options& options) {
  std::vector<RayCompetitor> competitors;
  for (const Builder& builder : builders) competitors.push_back(competitor_of(builder, mesh));
  Aabb box;
  for (const Vec3f& position : mesh.positions) box.grow(position);
  const std::vector<Ray> primary = primary_rays(box, options.view, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  competitors.front().closest(primary, hits.data());
  std::vector<JsonObject> objects(builders.size());
  double share = build_share(options);
  for (const RaySet& set : make_ray_sets(mesh, box, options.view, primary, hits)) {
    const bool is_wanted = set.name == "primary" || set.name == "diffuse" || set.name == "occlusion";
    if (!is_wanted || set.rays.empty()) continue;
    tell_progress(share);
    share += (1 - build_share(options)) / 3;
    const std::vector<RaceResult> results = race(set, competitors, options.ray_rounds);
    for (std::size_t i = 0; i < builders.size(); ++i) {
      JsonObject row;
      row.add("ray_count", set.rays.size()).add("mrays_per_second", results[i].mrays_per_second);
      row.add("rounds", results[i].rounds);
      add_counts(row, builders[i], set);
      objects[i].add_raw(set.name.c_str(), row.text());
    }
  }
  std::vector<std::string> texts;
  for (const JsonObject& object : objects) texts.push_back(object.text());
  return texts;
}

// Reports ----------------------------------------------------------------------------------------------------------

void add_statistics(JsonObject& row, const Snapshot& snapshot, ThreadPool& pool) {
  CancelToken cancel;
  StatisticsOptions options;
  options.is_detailed = true;
  const TreeStatistics tree = measure(snapshot, options, pool, cancel).meshes.front();
  row.add("sah", tree.sah).add("epo", tree.epo).add("depth", tree.depth);
  row.add("leaf_count_variability", tree.leaf_count_variability).add("sibling_overlap", tree.sibling_overlap);
  row.add("reference_count", tree.reference_count).add("node_count", tree.node_count);
  row.add("ready_byte_count", tree.geometry_byte_count + tree.wide_byte_count);
  row.add("binary_byte_count", tree.binary_byte_count);
}

// As the engine's own reports have it, by the wall clock.
std::string stages_of(const std::vector<CommitReport>& reports) {
  JsonObject stages;
  const auto add = [&](const char* name, auto milliseconds) {
    std::vector<double> times;
    for (const CommitReport& report : reports) times.push_back(milliseconds(report));
    stages.add(name, Spread::of(times).median);
  };
  add("build", [](const CommitReport& report) { return report.meshes.front().build_milliseconds; });
  add("optimize", [](const CommitReport& report) { return report.meshes.front().optimize_milliseconds; });
  add("collapse", [](const CommitReport& report) { return report.meshes.front().collapse_milliseconds; });
  add("top level", [](const CommitReport& report) { return report.top_level_milliseconds; });
  return stages.text();
}

std::string bench(const Options& options, const TriangleMesh& mesh) {
  ThreadPool pool(options.threads);
  std::vector<Builder> builders;
  for (const TreeChoice& choice : options.trees) builders.push_back(our_builder(choice, mesh, pool));
  for (const std::string& peer : options.peers) builders.push_back(embree_builder(peer, mesh, options.threads));
  run_builds(builders, options);
  std::vector<std::string> rays;
  if (options.ray_rounds > 0) rays = run_rays(builders, mesh, options);
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < builders.size(); ++i) {
    const Builder& builder = builders[i];
    JsonObject row;
    row.add("name", builder.name).add("ready_ms", Spread::of(builder.ready_ms));
    row.add("round_count", builder.ready_ms.size());
    if (builder.snapshot) {
      row.add("build_ms", Spread::of(builder.build_ms)).add_raw("stage_ms", stages_of(builder.reports));
      if (options.ray_rounds > 0) add_statistics(row, *builder.snapshot, pool);
    } else {
      row.add("ready_byte_count", builder.byte_count);
    }
    if (!rays.empty()) row.add_raw("rays", rays[i]);
    rows.push_back(row.text());
  }
  JsonObject result;
  result.add("triangle_count", mesh.triangle_count()).add("threads", options.threads).add("trees", rows);
  return result.text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  using namespace perfect_bvh::bench;
  return run_program(count, values, parse,
                     [](const Options& options) { return bench(options, read_mesh(options.mesh)); });
}
