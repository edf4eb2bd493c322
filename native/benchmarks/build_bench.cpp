// build_bench [options] MESH.bin
//   --tree NAME:BUILDER[,SETTING=VALUE...]   one of our trees (tree_choice.h); any number of them
//   --peers a,b      of embree_low, embree_medium, embree_high (all); none: ours alone
//   --threads N      of both sides, for builds (1)       --rounds N         interleaved rounds, at least (5)
// --least-seconds S  more rounds of builds until S seconds have passed (0)
// --seconds S      start no round of builds after S seconds (60)
//   --warm           all builds in one process, rather than each in its own
//   --ray-rounds N   interleaved rounds of rays; 0: none, and no statistics of the trees (5)
// --size WxH       of the image of primary rays (640x400)                --inside  the camera is inside the box
// --json OUT.json  --noisy  measure at any load
//
// Builds: see tree_builds.h. Rays: see ray_race.h; always on one thread. Prints "progress SHARE" lines.
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "arguments.h"
#include "embree_build.h"
#include "embree_peer.h"
#include "json.h"
#include "mesh_motions.h"
#include "our_rays.h"
#include "program.h"
#include "query/tree_boxes.h"
#include "ray_race.h"
#include "ray_sets.h"
#include "tree_builds.h"
#include "tree_scene.h"

namespace perfect_bvh::bench {
namespace {

struct Options : CommonOptions {
  std::vector<TreeChoice> trees;
  std::vector<std::string> peers{"embree_low", "embree_medium", "embree_high"};
  int threads = 1, ray_rounds = 5;
  double least_seconds = 0, seconds = 60;
  bool is_warm = false;
  View view = View::kOutside;
  std::string mesh;
};

void set(Options& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (set_common(options, arguments)) return;
  if (name == "--tree") {
    options.trees.push_back(parse_tree(arguments.value()));
  } else if (name == "--peers") {
    options.peers = arguments.list();
  } else if (name == "--threads") {
    options.threads = std::stoi(arguments.value());
  } else if (name == "--ray-rounds") {
    options.ray_rounds = std::stoi(arguments.value());
  } else if (name == "--least-seconds") {
    options.least_seconds = std::stod(arguments.value());
  } else if (name == "--seconds") {
    options.seconds = std::stod(arguments.value());
  } else if (name == "--inside") {
    options.view = View::kInside;
  } else if (name == "--warm") {
    options.is_warm = true;
  } else {
    options.mesh = arguments.path();
  }
}

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) set(options, arguments);
  if (options.mesh.empty()) throw std::runtime_error("build_bench: no mesh given");
  if (options.trees.empty()) options.trees.push_back(parse_tree("auto:auto"));
  return options;
}

void tell_progress(double share) {
  std::printf("progress %.3f\n", share);
  std::fflush(stdout);
}

// Estimates the share of the time that builds take; the rest is for rays.
double build_share(const Options& options) { return options.ray_rounds > 0 ? 0.3 : 1.0; }

// Rays -------------------------------------------------------------------------------------------------------------

// The trees that rays are cast at: ours first, in the order of the builders.
struct Traced {
  std::vector<RayCompetitor> competitors;
  std::vector<std::shared_ptr<const Snapshot>> scenes;
};

Traced make_traced(const Options& options, const Mesh& mesh) {
  Traced traced;
  for (const TreeChoice& choice : options.trees) {
    traced.scenes.push_back(committed(mesh, choice.config, choice.usage));
    traced.competitors.push_back({choice.name, std::make_shared<OurRays>(traced.scenes.back())});
  }
  for (const std::string& name : options.peers) {
    EmbreePeer::Options peer;
    peer.quality = embree_quality(name);
    traced.competitors.push_back(embree_competitor(name, std::make_shared<const EmbreePeer>(mesh, peer)));
  }
  return traced;
}

// Returns an object for each competitor, with a row for each kind of ray.
std::vector<std::string> run_rays(const Traced& traced, const Mesh& mesh, const Options& options) {
  const Aabb box = bounds_of_positions(mesh.positions);
  const std::vector<Ray> primary = primary_rays(box, options.view, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  traced.competitors.front().caster->answer(primary, {false, true}, std::span(hits));
  std::vector<JsonObject> objects(traced.competitors.size());
  double share = build_share(options);
  for (const RaySet& set : make_ray_sets(mesh, box, options.view, primary, hits)) {
    const bool is_wanted = set.name == "primary" || set.name == "diffuse" || set.name == "occlusion";
    if (!is_wanted || set.rays.empty()) continue;
    tell_progress(share);
    share += (1 - build_share(options)) / 3;
    const auto diagonal = static_cast<double>(length(box.extent()));
    const std::vector<RaceResult> results = race(set, traced.competitors, {options.ray_rounds, kBatch, diagonal});
    for (std::size_t i = 0; i < objects.size(); ++i) {
      JsonObject row;
      row.add("ray_count", set.rays.size()).add("mrays_per_second", results[i].mrays_per_second);
      row.add("rounds", results[i].rounds).add("different_from_first", results[i].agreement.different);
      if (i < traced.scenes.size()) {
        const Visits visits = count_visits(*traced.scenes[i], set);
        row.add("nodes_visited", visits.nodes).add("primitives_tested", visits.triangles);
      }
      objects[i].add_raw(set.name.c_str(), row.text());
    }
  }
  std::vector<std::string> texts;
  for (const JsonObject& object : objects) texts.push_back(object.text());
  return texts;
}

// Reports ----------------------------------------------------------------------------------------------------------

void add_statistics(JsonObject& row, const Snapshot& scene) {
  ThreadPool pool(1);
  CancelToken cancel;
  const TreeStatistics tree = measure(scene, true, pool, cancel).meshes.front();
  row.add("sah", tree.sah).add("epo", tree.epo).add("depth", tree.depth);
  row.add("leaf_count_variability", tree.leaf_count_variability).add("sibling_overlap", tree.sibling_overlap);
  row.add("reference_count", tree.reference_count).add("node_count", tree.node_count);
  row.add("ready_byte_count", tree.geometry_byte_count + tree.wide_byte_count);
}

std::string stages_of(const Builder& builder) {
  JsonObject stages;
  for (std::size_t i = 0; i < std::size(kStages); ++i) stages.add(kStages[i], Spread::of(builder.stage_ms[i]).median);
  return stages.text();
}

std::string bench(const Options& options) {
  const Mesh mesh = read_mesh(options.mesh);
  std::vector<Builder> builders;
  for (const TreeChoice& choice : options.trees) builders.push_back(our_builder(choice, mesh, options.threads));
  for (const std::string& peer : options.peers) builders.push_back(embree_builder(peer, mesh, options.threads));
  const auto tell = [&](double share) { tell_progress(build_share(options) * share); };
  race_builds(builders, {options.rounds, options.least_seconds, options.seconds, !options.is_warm, tell});
  Traced traced;
  std::vector<std::string> rays;
  if (options.ray_rounds > 0) traced = make_traced(options, mesh), rays = run_rays(traced, mesh, options);
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < builders.size(); ++i) {
    const Builder& builder = builders[i];
    JsonObject row;
    row.add("name", builder.name).add("ready_ms", Spread::of(builder.ready_ms));
    row.add("round_count", builder.ready_ms.size());
    if (builder.is_ours()) {
      row.add("build_ms", Spread::of(builder.build_ms)).add_raw("stage_ms", stages_of(builder));
      if (!rays.empty()) add_statistics(row, *traced.scenes[i]);
    } else {
      row.add("ready_byte_count", builder.byte_count);
    }
    if (!rays.empty()) row.add_raw("rays", rays[i]);
    rows.push_back(row.text());
  }
  JsonObject result;
  result.add("triangle_count", mesh.primitive_count()).add("threads", options.threads);
  result.add_raw("is_cold", options.is_warm ? "false" : "true");
  return result.add("trees", rows).text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
