// trace_bench [options] MESH.bin...
//   --rounds N       interleaved rounds (7)
//   --kinds a,b      of primary,tiled,shadow,diffuse,shuffled,occlusion (all)
//   --isas a,b       kernels (all)                       --in-flight a,b    rays under way (0: the default)
//   --strategies a,b of auto,packets,stream,single (auto)
//   --layouts a,b    of default,compact (default)
//   --peers a,b      embree, embree_avx2, embree_robust, embree_compact, embree_packets (embree)
//   --size WxH       of the image (640x400)              --json OUT.json
//   --leaks N        instead: N rays at random vertices and N at random edge points of closed, star-shaped meshes
//                    around the origin, from inside; prints how many pass through
//   --reinsert N     reinsertion passes for our tree      --inside           the camera stands inside the box
//
// Casts the same rays with every competitor, in chunks, all competitors in turn on each chunk, in random order. The
// time is the thread's own CPU time. A competitor's figure is the sum over chunks of the lower third of its times on
// each; ratios are to Embree's default (rtcIntersect1, rtcOccluded1, quality MEDIUM, not robust).
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <numeric>
#include <random>
#include <tuple>

#include "arguments.h"
#include "blas/build_tree.h"
#include "embree_peer.h"
#include "ray_sets.h"
#include "traverse/dispatch.h"
#include "tree_choice.h"
#include "ways.h"
#include "wide/collapse.h"

namespace perfect_bvh::bench {
namespace {

struct Options {
  int rounds = 7;
  std::vector<std::string> kinds, isas, in_flight{"0"}, strategies{"auto"}, layouts{"default"}, peers{"embree"}, meshes;
  std::uint32_t width = 640, height = 400, reinsert = 0;
  std::size_t leaks = 0;
  std::string json;
  bool inside = false;
};

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) {
    const std::string& name = arguments.name();
    if (name == "--rounds") {
      options.rounds = std::stoi(arguments.value());
    } else if (name == "--kinds") {
      options.kinds = arguments.list();
    } else if (name == "--isas") {
      options.isas = arguments.list();
    } else if (name == "--in-flight") {
      options.in_flight = arguments.list();
    } else if (name == "--strategies") {
      options.strategies = arguments.list();
    } else if (name == "--layouts") {
      options.layouts = arguments.list();
    } else if (name == "--peers") {
      options.peers = arguments.list();
    } else if (name == "--reinsert") {
      options.reinsert = static_cast<std::uint32_t>(std::stoul(arguments.value()));
    } else if (name == "--leaks") {
      options.leaks = std::stoul(arguments.value());
    } else if (name == "--json") {
      options.json = arguments.value();
    } else if (name == "--inside") {
      options.inside = true;
    } else if (name == "--size") {
      std::tie(options.width, options.height) = arguments.size();
    } else {
      options.meshes.push_back(name);
    }
  }
  return options;
}

double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double bytes_a_triangle(std::size_t bytes, const TriangleMesh& mesh) {
  return static_cast<double>(bytes) / static_cast<double>(mesh.triangle_count());
}

// A scene of one mesh in its own place, with the tree that meshes get by default.
struct SingleMesh {
  Bvh2 binary;
  WideBvh wide;
  IndexedLeaves indexed_leaves;
  double bytes_a_triangle;
  InstanceView instance{};
  SceneView view;

  SingleMesh(const TriangleMesh& mesh, TreeLayout layout, std::uint32_t reinsertion_passes) {
    ThreadPool pool(1);
    CancelToken cancel;
    BuildConfig config;
    config.layout = layout;
    config.optimize_passes = reinsertion_passes;
    binary = build_tree(mesh, choose_builder(config, Usage::kStatic), pool, cancel);
    wide = collapse_mesh(binary, mesh, layout, pool, cancel);
    for (int i = 0; i < 3; ++i) instance.world_to_local[i][i] = static_cast<double>(wide.scale);
    bytes_a_triangle = bench::bytes_a_triangle(wide.byte_count() + mesh.byte_count(), mesh);
    instance.nodes = wide.nodes.data();
    indexed_leaves = {wide.indexed_leaves.data(), mesh.triangles.data(), mesh.positions.data(), wide.scale};
    instance.is_compact = layout == TreeLayout::kCompact;
    if (instance.is_compact != 0) {
      instance.indexed_leaves = &indexed_leaves;
    } else {
      instance.blocks = wide.blocks.data();
    }
    instance.extent = wide.extent, instance.root = wide.root, instance.mask = ~0u;
    view.instances = &instance;
    view.extent = wide.extent, view.reach = wide.extent.reach;
    view.root = kInstanceChild, view.is_empty = wide.is_empty;
    view.exceeds_cache = wide.byte_count() > kCachedBytes;
    view.stack_entries = 7 * wide.depth + 4;
  }
};

struct Competitor {
  std::string name;
  std::function<void(std::span<const Ray>, Hit*)> closest;
  std::function<void(std::span<const Ray>, std::uint8_t*)> any;
  double bytes_a_triangle = 0;             // with the mesh
  std::vector<std::vector<double>> times;  // by chunk
  std::size_t different = 0;
};

Competitor make_ours(const SingleMesh& ours, const std::string& isa, const std::string& strategy,
                     const std::string& in_flight) {
  const TraceOptions trace_options{parse_strategy(strategy), std::stoul(in_flight)};
  const std::string name = way_name(isa, strategy, ours.wide.layout) + (in_flight == "0" ? "" : "/" + in_flight);
  return {name,
          [&ours, isa, trace_options](std::span<const Ray> rays, Hit* hits) {
            set_active_kernels(isa);
            trace_closest(ours.view, {rays.data(), rays.size(), Cull::kNone, nullptr, hits, nullptr}, trace_options);
          },
          [&ours, isa, trace_options](std::span<const Ray> rays, std::uint8_t* occluded) {
            set_active_kernels(isa);
            trace_any(ours.view, {rays.data(), rays.size(), Cull::kNone, nullptr, nullptr, occluded}, trace_options);
          },
          ours.bytes_a_triangle,
          {},
          0};
}

std::vector<Competitor> make_competitors(const Options& options, const TriangleMesh& mesh,
                                         const std::vector<std::unique_ptr<SingleMesh>>& ours) {
  std::vector<Competitor> list;
  for (const std::string& name : options.peers) {
    const auto peer = std::make_shared<EmbreePeer>(mesh, EmbreePeer::named(name));
    std::printf("  %s: %.1f bytes a triangle with the mesh\n", name.c_str(),
                bytes_a_triangle(peer->byte_count(), mesh));
    const bool packets = name.find("packets") != std::string::npos;
    list.push_back({name,
                    [peer, packets](std::span<const Ray> rays, Hit* hits) {
                      if (packets) {
                        peer->closest_packets(rays, hits, true);
                      } else {
                        peer->closest(rays, hits);
                      }
                    },
                    [peer](std::span<const Ray> rays, std::uint8_t* occluded) { peer->any(rays, occluded); },
                    bytes_a_triangle(peer->byte_count(), mesh),
                    {},
                    0});
  }
  std::vector<std::string> isas = options.isas;
  if (isas.empty()) {
    for (const KernelTable* table : available_kernels()) {
      if (std::strcmp(table->name, "scalar") != 0) isas.push_back(table->name);
    }
  }
  for (const std::string& isa : isas) {
    for (const std::string& strategy : options.strategies) {
      for (const std::string& in_flight : options.in_flight) {
        for (const auto& tree : ours) {
          list.push_back(make_ours(*tree, isa, strategy, in_flight));
        }
      }
    }
  }
  return list;
}

constexpr std::size_t kChunk = 8192;

// Hits that differ from the first competitor's: another triangle, and t further away than 1e-5 of the diagonal.
std::size_t count_different(const std::vector<Hit>& a, const std::vector<Hit>& b, std::size_t count, float tolerance) {
  std::size_t different = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (a[i].found() != b[i].found() || (a[i].found() && !(std::abs(a[i].t - b[i].t) <= tolerance))) ++different;
  }
  return different;
}

void run(const RaySet& set, std::vector<Competitor>& competitors, int rounds, float diagonal) {
  const std::size_t chunk_count = std::max<std::size_t>(set.rays.size() / kChunk, 1);
  std::vector<std::size_t> turns(competitors.size());
  std::iota(turns.begin(), turns.end(), std::size_t{0});
  std::mt19937 random(11);
  std::vector<Hit> first(kChunk), hits(kChunk);
  std::vector<std::uint8_t> first_any(kChunk), occluded(kChunk);
  for (Competitor& competitor : competitors) competitor.times.assign(chunk_count, {}), competitor.different = 0;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t chunk = 0; chunk < chunk_count; ++chunk) {
      const std::size_t begin = chunk * kChunk, count = std::min(kChunk, set.rays.size() - begin);
      const std::span<const Ray> rays(set.rays.data() + begin, count);
      if (round == 0) competitors[0].closest(rays, first.data()), competitors[0].any(rays, first_any.data());
      std::shuffle(turns.begin(), turns.end(), random);  // who comes after whom decides whose tree is in the cache
      for (const std::size_t turn : turns) {
        Competitor& competitor = competitors[turn];
        const double start = cpu_seconds();
        if (set.is_any_hit) {
          competitor.any(rays, occluded.data());
        } else {
          competitor.closest(rays, hits.data());
        }
        competitor.times[chunk].push_back(cpu_seconds() - start);
        if (round != 0) continue;
        competitor.different += set.is_any_hit
                                    ? static_cast<std::size_t>(std::inner_product(
                                          first_any.begin(), first_any.begin() + static_cast<std::ptrdiff_t>(count),
                                          occluded.begin(), 0, std::plus<>(), std::not_equal_to<>()))
                                    : count_different(first, hits, count, 1e-5f * diagonal);
      }
    }
  }
}

double lower_third(std::vector<double> times) {
  const auto place = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 3);
  std::nth_element(times.begin(), place, times.end());
  return *place;
}

double seconds_of(const Competitor& competitor) {
  double sum = 0;
  for (const auto& times : competitor.times) sum += lower_third(times);
  return sum;
}

void report(const std::string& mesh, const RaySet& set, const std::vector<Competitor>& competitors, std::string& json) {
  const double rays =
      static_cast<double>(std::max<std::size_t>(set.rays.size() / kChunk, 1) * std::min(kChunk, set.rays.size()));
  const double base = seconds_of(competitors[0]);
  std::printf("%-10s %-10s", mesh.c_str(), set.name.c_str());
  for (const Competitor& competitor : competitors) {
    const double seconds = seconds_of(competitor);
    std::printf("  %s %.2f M/s (%.3f, %zu)", competitor.name.c_str(), rays / seconds * 1e-6, base / seconds,
                competitor.different);
    json += (json.empty() ? "" : ",\n") + std::string("  {\"mesh\": \"") + mesh + "\", \"rays\": \"" + set.name +
            "\", \"competitor\": \"" + competitor.name +
            "\", \"mrays_per_second\": " + std::to_string(rays / seconds * 1e-6) +
            ", \"ratio\": " + std::to_string(base / seconds) +
            ", \"bytes_a_triangle\": " + std::to_string(competitor.bytes_a_triangle) +
            ", \"different_from_first\": " + std::to_string(competitor.different) +
            ", \"ray_count\": " + std::to_string(set.rays.size()) + "}";
  }
  std::printf("\n");
  std::fflush(stdout);
}

void report_leaks(const std::string& mesh_name, const TriangleMesh& mesh, std::vector<Competitor>& competitors,
                  std::size_t ray_count) {
  for (const bool at_edges : {false, true}) {
    std::vector<std::size_t> leaks(competitors.size(), 0);
    for (std::size_t first = 0; first < ray_count; first += kChunk) {
      const std::vector<Ray> rays = aimed_rays(mesh, std::min(kChunk, ray_count - first), at_edges, first);
      for (std::size_t i = 0; i < competitors.size(); ++i) {
        std::vector<std::uint8_t> occluded(rays.size());
        std::vector<Hit> hits(rays.size());
        competitors[i].any(rays, occluded.data());
        competitors[i].closest(rays, hits.data());
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

void bench_mesh(const std::string& path, const Options& options, std::string& json) {
  const TriangleMesh mesh = read_mesh(path);
  const std::string name = stem(path);
  std::printf("%s: %zu triangles\n", name.c_str(), mesh.triangle_count());
  std::vector<std::unique_ptr<SingleMesh>> ours;
  for (const std::string& layout : options.layouts) {
    const double start = cpu_seconds();
    ours.push_back(std::make_unique<SingleMesh>(mesh, parse_layout(layout), options.reinsert));
    const WideBvh& wide = ours.back()->wide;
    std::printf(
        "  %s: built in %.1f ms, %zu nodes, %zu leaves (%.2f triangles), depth %u, %.1f bytes a triangle with the "
        "mesh\n",
        layout.c_str(), 1e3 * (cpu_seconds() - start), wide.nodes.size(), wide.leaf_count(),
        static_cast<double>(mesh.triangle_count()) / static_cast<double>(wide.leaf_count()), wide.depth,
        ours.back()->bytes_a_triangle);
  }
  const Aabb box = ours.front()->binary.bounds();
  std::vector<Competitor> competitors = make_competitors(options, mesh, ours);
  if (options.leaks != 0) return report_leaks(name, mesh, competitors, options.leaks);
  const View view = options.inside || name == "sponza" ? View::kInside : View::kOutside;
  const std::vector<Ray> primary = primary_rays(box, view, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  competitors[0].closest(primary, hits.data());
  std::vector<RaySet> sets = make_ray_sets(mesh, box, view, primary, hits);
  for (RaySet& set : make_coherent_sets(box, primary, hits, options.width)) sets.push_back(std::move(set));
  for (const RaySet& set : sets) {
    if (!options.kinds.empty() &&
        std::find(options.kinds.begin(), options.kinds.end(), set.name) == options.kinds.end())
      continue;
    run(set, competitors, options.rounds, length(box.extent()));
    report(name, set, competitors, json);
  }
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  using namespace perfect_bvh::bench;
  try {
    const Options options = parse(count, values);
    std::string json;
    for (const std::string& mesh : options.meshes) bench_mesh(mesh, options, json);
    if (!options.json.empty()) std::ofstream(options.json) << "[\n" << json << "\n]\n";
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
