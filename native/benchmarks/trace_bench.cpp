// trace_bench [options] MESH.bin...
//   --rounds N       interleaved rounds (7)               --batches a,b      rays a call (8192)
// --kinds a,b      of primary,tiled,shadow,diffuse,shuffled,occlusion (all)
//   --isas a,b       kernels (all)                        --in-flight a,b    rays under way (0: the default)
//   --strategies a,b of auto,packets,stream,single (auto)
//   --peers a,b      of embree, and that with _avx2, _robust, _high, _packets in its name (embree)
//   --size WxH       of the image (640x400)               --json OUT.json
// --leaks N        instead: N rays at random vertices and N at random edge points of closed, star-shaped meshes
//                    around the origin, from inside; prints how many pass through
//   --reinsert N     reinsertion passes for our tree
// --inside         the camera is inside the box         --filling          or so near that the mesh fills the view
// --noisy          measure at any load
// --visits         count the nodes that our rays visit and the triangles they test, in another run
//
// Casts the same rays with every competitor (ray_race.h), each in its own format. Ratios are to the first one: Embree's
// default (rtcIntersect1, rtcOccluded1, quality MEDIUM, not robust) unless --peers says otherwise.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "arguments.h"
#include "embree_peer.h"
#include "json.h"
#include "mesh_motions.h"
#include "our_rays.h"
#include "program.h"
#include "ray_race.h"
#include "ray_sets.h"
#include "traverse/dispatch.h"
#include "tree_scene.h"
#include "ways.h"

namespace perfect_bvh::bench {
namespace {

struct Options : CommonOptions {
  Options() { rounds = 7; }

  std::vector<std::string> kinds, isas, in_flight{"0"}, strategies{"auto"}, peers{"embree"}, meshes;
  std::vector<std::size_t> batches{kBatch};
  std::uint32_t reinsert = 0;
  std::size_t leaks = 0;
  View view = View::kOutside;
  bool counts_visits = false;

  [[nodiscard]] bool wants(const std::string& kind) const {
    return kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  }
};

void set(Options& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (set_common(options, arguments)) return;
  if (name == "--batches") {
    options.batches.clear();
    for (const std::string& batch : arguments.list()) options.batches.push_back(std::stoul(batch));
  } else if (name == "--kinds") {
    options.kinds = arguments.list();
  } else if (name == "--isas") {
    options.isas = arguments.list();
  } else if (name == "--in-flight") {
    options.in_flight = arguments.list();
  } else if (name == "--strategies") {
    options.strategies = arguments.list();
  } else if (name == "--peers") {
    options.peers = arguments.list();
  } else if (name == "--reinsert") {
    options.reinsert = static_cast<std::uint32_t>(std::stoul(arguments.value()));
  } else if (name == "--leaks") {
    options.leaks = std::stoul(arguments.value());
  } else if (name == "--inside") {
    options.view = View::kInside;
  } else if (name == "--filling") {
    options.view = View::kFilling;
  } else if (name == "--visits") {
    options.counts_visits = true;
  } else {
    options.meshes.push_back(arguments.path());
  }
}

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) set(options, arguments);
  if (options.meshes.empty()) throw std::runtime_error("trace_bench: no mesh given");
  return options;
}

struct Competitor : RayCompetitor {
  double bytes_a_triangle;                // including the mesh
  std::shared_ptr<const Snapshot> scene;  // only for our competitors
};

double bytes_a_triangle(std::size_t bytes, const Mesh& mesh) {
  return static_cast<double>(bytes) / static_cast<double>(mesh.primitive_count());
}

// Traces our tree with each instruction set and strategy.
void add_ours(std::vector<Competitor>& list, const Options& options, const std::shared_ptr<const Snapshot>& scene) {
  std::vector<std::string> isas = options.isas;
  if (isas.empty()) {
    for (const KernelTable* table : available_kernels()) {
      if (std::strcmp(table->name, "scalar") != 0) isas.push_back(table->name);
    }
  }
  const Blas& blas = *scene->blases.front();
  const double bytes = bytes_a_triangle(blas.wide.byte_count() + blas.mesh.byte_count(), blas.mesh);
  for (const std::string& isa : isas) {
    for (const std::string& strategy : options.strategies) {
      for (const std::string& in_flight : options.in_flight) {
        const std::string name = way_name(isa, strategy) + (in_flight == "0" ? "" : "/" + in_flight);
        const TraceOptions way{parse_strategy(strategy), std::stoul(in_flight)};
        list.push_back({{name, std::make_shared<OurRays>(scene, isa, way)}, bytes, scene});
      }
    }
  }
}

std::vector<Competitor> make_competitors(const Options& options, const Mesh& mesh) {
  std::vector<Competitor> list;
  for (const std::string& name : options.peers) {
    const auto peer = std::make_shared<const EmbreePeer>(mesh, EmbreePeer::named(name));
    list.push_back({embree_competitor(name, peer), bytes_a_triangle(peer->byte_count(), mesh), nullptr});
    std::printf("  %s: %.1f bytes a triangle with the mesh\n", name.c_str(), list.back().bytes_a_triangle);
  }
  BuildConfig config;
  config.optimize_passes = options.reinsert;
  const auto scene = committed(mesh, config);
  add_ours(list, options, scene);
  const WideBvh& wide = scene->blases.front()->wide;
  std::printf("  ours: %zu nodes, %zu leaves (%.2f triangles), depth %u, %.1f bytes a triangle with the mesh\n",
              wide.nodes.size(), wide.leaf_count(),
              static_cast<double>(mesh.primitive_count()) / static_cast<double>(wide.leaf_count()), wide.depth,
              list.back().bytes_a_triangle);
  return list;
}

void add_visits(JsonObject& row, const Competitor& competitor, const RaySet& set) {
  if (!competitor.scene) return;
  const Visits visits = count_visits(*competitor.scene, set);
  row.add("nodes_visited", visits.nodes).add("primitives_tested", visits.triangles);
}

void report(const std::string& mesh, const RaySet& set, std::size_t batch, const std::vector<Competitor>& competitors,
            const std::vector<RaceResult>& results, bool counts_visits, std::vector<std::string>& rows) {
  std::printf("%-10s %-10s %8zu", mesh.c_str(), set.name.c_str(), batch);
  for (std::size_t i = 0; i < competitors.size(); ++i) {
    const RaceResult& result = results[i];
    const double ratio = result.mrays_per_second / results.front().mrays_per_second;
    std::printf("  %s %.2f M/s (%.3f, %zu, %zu)", competitors[i].name.c_str(), result.mrays_per_second, ratio,
                result.agreement.different, result.agreement.other_triangle);
    JsonObject row;
    row.add("mesh", mesh).add("rays", set.name).add("batch", batch).add("competitor", competitors[i].name);
    row.add("mrays_per_second", result.mrays_per_second).add("ratio", ratio).add("rounds", result.rounds);
    row.add("bytes_a_triangle", competitors[i].bytes_a_triangle).add("ray_count", set.rays.size());
    row.add("different_from_first", result.agreement.different);
    row.add("other_triangle_than_first", result.agreement.other_triangle);
    if (counts_visits) add_visits(row, competitors[i], set);
    rows.push_back(row.text());
  }
  std::printf("\n");
  std::fflush(stdout);
}

void report_leaks(const std::string& mesh_name, const Mesh& mesh, std::vector<Competitor>& competitors,
                  std::size_t ray_count) {
  for (const bool at_edges : {false, true}) {
    std::vector<std::size_t> leaks(competitors.size(), 0);
    for (std::size_t first = 0; first < ray_count; first += kBatch) {
      const std::vector<Ray> rays = aimed_rays(mesh, std::min(kBatch, ray_count - first), at_edges, first);
      for (std::size_t i = 0; i < competitors.size(); ++i) {
        std::vector<std::uint8_t> occluded(rays.size());
        std::vector<Hit> hits(rays.size());
        competitors[i].caster->answer(rays, {true, false}, std::span(occluded));
        competitors[i].caster->answer(rays, {false, false}, std::span(hits));
        for (std::size_t ray = 0; ray < rays.size(); ++ray)
          leaks[i] += occluded[ray] == 0 || !hits[ray].found() ? 1u : 0u;
      }
    }
    std::printf("%-10s %zu rays at %s:", mesh_name.c_str(), ray_count, at_edges ? "edges" : "vertices");
    for (std::size_t i = 0; i < competitors.size(); ++i) std::printf("  %s %zu", competitors[i].name.c_str(), leaks[i]);
    std::printf("\n");
    std::fflush(stdout);
  }
}

std::string stem(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  const std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
  return name.substr(0, name.find('.'));
}

std::vector<RaySet> make_sets(const Options& options, const Mesh& mesh, const std::string& name, RayCaster& caster) {
  const Aabb box = bounds_of_positions(mesh.positions);
  const View view = name == "sponza" ? View::kInside : options.view;
  const std::vector<Ray> primary = primary_rays(box, view, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  caster.answer(primary, {false, true}, std::span(hits));
  std::vector<RaySet> sets = make_ray_sets(mesh, box, view, primary, hits);
  for (RaySet& set : make_coherent_sets(box, primary, hits, options.width)) sets.push_back(std::move(set));
  return sets;
}

void bench_mesh(const std::string& path, const Options& options, std::vector<std::string>& rows) {
  const Mesh mesh = read_mesh(path);
  const std::string name = stem(path);
  std::printf("%s: %zu triangles; in brackets: ratio, answers that differ, the same t on another triangle\n",
              name.c_str(), mesh.primitive_count());
  std::vector<Competitor> competitors = make_competitors(options, mesh);
  if (options.leaks != 0) return report_leaks(name, mesh, competitors, options.leaks);
  const std::vector<RayCompetitor> racing(competitors.begin(), competitors.end());
  const auto diagonal = static_cast<double>(length(bounds_of_positions(mesh.positions).extent()));
  for (const RaySet& set : make_sets(options, mesh, name, *racing.back().caster)) {
    if (!options.wants(set.name) || set.rays.empty()) continue;
    for (const std::size_t batch : options.batches) {
      const auto results = race(set, racing, {options.rounds, batch, diagonal});
      report(name, set, batch, competitors, results, options.counts_visits, rows);
    }
  }
}

std::string bench(const Options& options) {
  std::vector<std::string> rows;
  for (const std::string& mesh : options.meshes) bench_mesh(mesh, options, rows);
  return options.json.empty() ? "" : to_json(rows);
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
