// curve_bench [options] BALLS.bin
//   --rounds N       interleaved rounds (5)               --kinds a,b  of primary,diffuse,shuffled,occlusion (all)
// --size WxH       of the image (640x400)               --inside     the camera is inside the box
//   --build-rounds N interleaved rounds of builds and of refits; 0: none (5)
//   --peers a,b      of round, flat, cubic, tubes, ribbon; ours always (all)
// --isa NAME       of our kernels (the best)            --visits     count what our rays visit, in another run
// --json OUT.json  --noisy  measure at any load
//
// Curves or points (round_scene.h), compared with Embree's round linear, flat linear and cubic curves or its spheres,
// and with our own tessellation and our ribbons. Measures rays (ray_race.h; ratios to Embree's round ones, quality
// MEDIUM), builds, each in its own process, and refits in the wind, including the copy of the spheres. All run on one
// thread.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "arguments.h"
#include "embree_rays.h"
#include "embree_round.h"
#include "json.h"
#include "our_rays.h"
#include "program.h"
#include "ray_race.h"
#include "round_scene.h"
#include "scene/scene.h"
#include "tree_builds.h"
#include "tree_scene.h"

namespace perfect_bvh::bench {
namespace {

struct Options : CommonOptions {
  std::vector<std::string> kinds, peers{"round", "flat", "cubic", "tubes", "ribbon"};
  int build_rounds = 5;
  std::string isa, path;
  View view = View::kOutside;
  bool counts_visits = false;

  [[nodiscard]] bool wants(const std::string& kind) const {
    return kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  }
};

void set(Options& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (set_common(options, arguments)) return;
  if (name == "--kinds") {
    options.kinds = arguments.list();
  } else if (name == "--build-rounds") {
    options.build_rounds = std::stoi(arguments.value());
  } else if (name == "--peers") {
    options.peers = arguments.list();
  } else if (name == "--isa") {
    options.isa = arguments.value();
  } else if (name == "--inside") {
    options.view = View::kInside;
  } else if (name == "--visits") {
    options.counts_visits = true;
  } else {
    options.path = arguments.path();
  }
}

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) set(options, arguments);
  if (options.path.empty()) throw std::runtime_error("curve_bench: no curves given");
  return options;
}

EmbreeShape shape_named(const std::string& name) {
  if (name == "round") return EmbreeShape::kRound;
  if (name == "flat") return EmbreeShape::kFlat;
  if (name == "cubic") return EmbreeShape::kCubic;
  throw std::runtime_error("no peer is called " + name + "; there are round, flat, cubic, tubes, ribbon");
}

// Returns whether the peer has this kind of scene; for points Embree has only spheres.
bool is_raced(const RoundScene& scene, const std::string& peer) {
  return scene.has_curves() || peer == "round" || peer == "tubes";
}

// Rays -------------------------------------------------------------------------------------------------------------

struct Competitor : RayCompetitor {
  std::size_t byte_count;
  std::shared_ptr<const Snapshot> snapshot;  // only for our competitors
};

Competitor ours(const std::string& name, const Mesh& mesh, const std::string& isa) {
  const auto snapshot = committed(mesh, {}, Usage::kStatic);
  const Blas& blas = *snapshot->blases.front();
  return {{name, std::make_shared<OurRays>(snapshot, isa)}, blas.wide.byte_count() + blas.mesh.byte_count(), snapshot};
}

std::vector<Competitor> make_competitors(const RoundScene& scene, const Options& options) {
  std::vector<Competitor> list;
  for (const std::string& name : options.peers) {
    if (!is_raced(scene, name)) continue;
    if (name == "tubes") {
      list.push_back(ours(name, tessellated(scene), options.isa));
      continue;
    }
    if (name == "ribbon") {
      Mesh mesh = scene.mesh;
      mesh.shape = CurveShape::kRibbon;
      list.push_back(ours("ours ribbon", mesh, options.isa));
      continue;
    }
    const auto peer = std::make_shared<const EmbreeRound>(scene, EmbreeRound::Options{shape_named(name)});
    list.push_back(
        {{"embree " + name, std::make_shared<EmbreeRays>(peer, peer->scene())}, peer->byte_count(), nullptr});
  }
  list.push_back(ours("ours", scene.mesh, options.isa));
  return list;
}

std::vector<std::string> race_rays(const RoundScene& scene, const Options& options) {
  const std::vector<Competitor> competitors = make_competitors(scene, options);
  const std::vector<RayCompetitor> racing(competitors.begin(), competitors.end());
  const Snapshot& own = *competitors.back().snapshot;
  const auto diagonal = static_cast<double>(length(own.bounds.extent()));
  std::vector<std::string> rows;
  for (const RaySet& set : make_round_ray_sets(own, options.view, options.width, options.height)) {
    if (!options.wants(set.name) || set.rays.empty()) continue;
    const std::vector<RaceResult> results = race(set, racing, {options.rounds, kBatch, diagonal});
    for (std::size_t i = 0; i < competitors.size(); ++i) {
      const RaceResult& result = results[i];
      JsonObject row;
      row.add("rays", set.name).add("competitor", competitors[i].name).add("ray_count", set.rays.size());
      row.add("mrays_per_second", result.mrays_per_second).add("rounds", result.rounds);
      row.add("ratio", result.mrays_per_second / results.front().mrays_per_second);
      row.add("different_from_first", result.agreement.different);
      row.add("other_segment_than_first", result.agreement.other_triangle);
      row.add("byte_count", competitors[i].byte_count);
      if (options.counts_visits && competitors[i].snapshot) {
        const Visits visits = count_visits(*competitors[i].snapshot, set);
        row.add("nodes_visited", visits.nodes).add("primitives_tested", visits.triangles);
      }
      rows.push_back(row.text());
    }
  }
  return rows;
}

// Builds -----------------------------------------------------------------------------------------------------------

Builder embree_round_builder(const RoundScene& scene) {
  Builder builder;
  builder.name = "embree round";
  builder.ready = [&scene]() -> std::vector<double> {
    const EmbreeRound peer(scene, {EmbreeShape::kRound, 1, false});
    return {1e3 * peer.build_seconds(), static_cast<double>(peer.byte_count())};
  };
  return builder;
}

std::vector<std::string> race_all_builds(const RoundScene& scene, const Options& options) {
  if (options.build_rounds == 0) return {};
  const Mesh tubes = tessellated(scene);
  std::vector<Builder> builders;
  builders.push_back(embree_round_builder(scene));
  builders.push_back(our_builder({"tubes", {}, Usage::kStatic}, tubes, 1));
  builders.push_back(our_builder({"ours", {}, Usage::kStatic}, scene.mesh, 1));
  race_builds(builders, {options.build_rounds, 0, 60, true});
  std::vector<std::string> rows;
  for (const Builder& builder : builders) {
    rows.push_back(JsonObject().add("competitor", builder.name).add("ready_ms", Spread::of(builder.ready_ms)).text());
  }
  return rows;
}

// Refits -----------------------------------------------------------------------------------------------------------

// Times a whole update of ours; the governor may refit or rebuild.
struct OurCurves {
  ThreadPool pool{1};
  Scene scene;
  std::int32_t mesh_id;
  PrimitiveKind kind;

  explicit OurCurves(const RoundScene& round) : kind(round.mesh.kind) {
    CancelToken cancel;
    mesh_id = scene.add_mesh(round.mesh, BuildConfig{}, Usage::kDeforming);
    scene.add_instances(std::vector<InstanceInput>{{mesh_id, Affine{}, ~0u, std::nullopt}});
    static_cast<void>(scene.commit(pool, cancel));
  }
  double move(std::span<const Vec3f> centres) {
    CancelToken cancel;
    const double start = seconds(1);
    scene.update_balls<float>(mesh_id, kind, {centres, {}}, pool);
    static_cast<void>(scene.commit(pool, cancel));
    return seconds(1) - start;
  }
};

std::vector<std::string> race_refits(const RoundScene& scene, const Options& options) {
  if (options.build_rounds == 0 || scene.frames.empty()) return {};
  OurCurves own(scene);
  EmbreeRound peer(scene, {EmbreeShape::kRound, 1, true});
  std::vector<double> own_ns, peer_ns;
  constexpr int kWarmUp = 3;  // rounds that allocate the memory
  const double each = 1e9 / static_cast<double>(scene.mesh.primitive_count());
  for (int round = 0; round < kWarmUp + options.build_rounds; ++round) {
    const std::vector<Vec3f>& centres = scene.frames[static_cast<std::size_t>(round) % scene.frames.size()];
    double taken[2];
    for (const int turn : {round % 2, 1 - round % 2}) taken[turn] = turn == 0 ? own.move(centres) : peer.move(centres);
    if (round < kWarmUp) continue;
    own_ns.push_back(each * taken[0]), peer_ns.push_back(each * taken[1]);
  }
  return {JsonObject().add("competitor", std::string("embree round")).add("ns_a_primitive", Spread::of(peer_ns)).text(),
          JsonObject().add("competitor", std::string("ours")).add("ns_a_primitive", Spread::of(own_ns)).text()};
}

std::string bench(const Options& options) {
  const RoundScene scene = read_round_scene(options.path);
  JsonObject object;
  object.add("primitive_count", scene.mesh.primitive_count());
  // Builds come first: each runs in a fork of this process, which must not have started threads yet.
  object.add_raw("builds", to_json(race_all_builds(scene, options)));
  object.add_raw("rays", to_json(race_rays(scene, options)));
  object.add_raw("refits", to_json(race_refits(scene, options)));
  return object.text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
