// instance_bench [options] MESH.bin
//   --counts a,b     instances (1000,10000,100000)       --layouts a,b      of grid,heap (both)
//   --threads N      of both sides, for commits (1)      --rounds N         interleaved rounds (5)
//   --kinds a,b      of commit,primary,diffuse (all)     --json OUT.json
//   --peers a,b      of embree,low,array,array_low (embree,low,array): Embree's instances as geometries, with quality
//                    LOW and the dynamic flag, as one array, and that with both; rays are cast at the first alone
//   --strategies a,b of auto,packets,stream,single (auto): how our rays are traced
//
// Commits: every instance gets another transform, then the scene is committed; all competitors in turn, the median of
// the rounds. "set" is the time of handing over the transforms (Embree computes inverses there, ours in the commit).
// With one thread the time is the thread's own CPU time, otherwise that of the wall clock.
// Rays: the same rays on one thread, in chunks as in trace_bench; ratios are to Embree's instances at MEDIUM. How many
// instances a ray enters is counted in another run of ours.
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <random>

#include "arguments.h"
#include "embree_instances.h"
#include "instance_layouts.h"
#include "query/trace.h"
#include "ray_sets.h"
#include "scene/scene.h"

namespace perfect_bvh::bench {
namespace {

struct Options {
  std::vector<std::string> layouts{"grid", "heap"}, kinds{"commit", "primary", "diffuse"};
  std::vector<std::string> peers{"embree", "low", "array"}, strategies{"auto"};
  std::vector<std::size_t> counts{1000, 10000, 100000};
  int threads = 1, rounds = 5;
  std::string json, mesh;

  [[nodiscard]] bool wants(const char* kind) const {
    return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  }
};

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) {
    const std::string& name = arguments.name();
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
    } else if (name == "--rounds") {
      options.rounds = std::stoi(arguments.value());
    } else if (name == "--json") {
      options.json = arguments.value();
    } else {
      options.mesh = name;
    }
  }
  if (options.mesh.empty()) throw std::runtime_error("no mesh given");
  return options;
}

double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds(int threads) {
  if (threads == 1) return thread_seconds();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double lower_third(std::vector<double> values) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 3);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// Ours -------------------------------------------------------------------------------------------------------------

class Ours {
 public:
  Ours(const TriangleMesh& mesh, std::span<const Affine> transforms, ThreadPool& pool) : pool_(pool) {
    const std::int32_t mesh_id = scene_.add_mesh(mesh, BuildConfig{}, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (const Affine& map : transforms) inputs.push_back({mesh_id, map, 0xFFFFFFFFu, std::nullopt});
    const std::int32_t first = scene_.add_instances(inputs);
    for (std::size_t i = 0; i < transforms.size(); ++i) ids_.push_back(first + static_cast<std::int32_t>(i));
  }

  void set_transforms(std::span<const Affine> transforms) { scene_.set_transforms(ids_, transforms); }
  void commit() {
    CancelToken cancel;
    snapshot_.reset();  // as Embree does: what is about to be replaced is not traced
    report_ = scene_.commit(pool_, cancel);
    snapshot_ = scene_.snapshot();
  }
  [[nodiscard]] const CommitReport& report() const { return report_; }
  [[nodiscard]] const Snapshot& snapshot() const { return *snapshot_; }

 private:
  ThreadPool& pool_;
  Scene scene_;
  std::vector<std::int32_t> ids_;
  CommitReport report_;
  std::shared_ptr<const Snapshot> snapshot_;
};

// Commits ----------------------------------------------------------------------------------------------------------

struct Competitor {
  std::string name;
  std::function<void(std::span<const Affine>)> set;
  std::function<void()> commit;
  std::function<void(std::span<const Ray>, Hit*)> closest;
  std::vector<double> set_times, commit_times;
  std::vector<std::vector<double>> chunk_times;
  std::size_t different = 0;
};

void run_commits(std::vector<Competitor>& competitors, const Options& options, const std::vector<Affine> (&placed)[2]) {
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t turn = 0; turn < competitors.size(); ++turn) {
      Competitor& competitor = competitors[(turn + static_cast<std::size_t>(round)) % competitors.size()];
      const double start = seconds(options.threads);
      competitor.set(placed[(round + 1) % 2]);
      const double middle = seconds(options.threads);
      competitor.commit();
      competitor.commit_times.push_back(seconds(options.threads) - middle);
      competitor.set_times.push_back(middle - start);
    }
  }
  for (Competitor& competitor : competitors) competitor.set(placed[0]), competitor.commit();
}

// Rays -------------------------------------------------------------------------------------------------------------

std::vector<Ray> bounces(const Snapshot& snapshot, const std::vector<Ray>& primary, float diagonal) {
  std::vector<Hit> hits(primary.size());
  trace_closest(snapshot, primary, hits);
  std::vector<Ray> result;
  std::mt19937 random(5);
  for (std::size_t i = 0; i < primary.size(); ++i) {
    if (!hits[i].found()) continue;
    Vec3d normal = geometric_normal(snapshot, hits[i]);
    if (dot(normal, normal) < 0.5) continue;
    if (dot(normal, primary[i].direction) > 0) normal = -normal;
    const Vec3d origin = hit_position(snapshot, hits[i]) + normal * (1e-4 * static_cast<double>(diagonal));
    result.push_back(diffuse_ray(origin, normal, random));
  }
  return result;
}

constexpr std::size_t kChunk = 8192;

// Found by one and not by the other, or t further apart than 1e-4 of it.
std::size_t count_different(const std::vector<Hit>& a, const std::vector<Hit>& b, std::size_t count) {
  std::size_t different = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (a[i].found() != b[i].found() || (a[i].found() && !(std::abs(a[i].t - b[i].t) <= 1e-4f * a[i].t))) ++different;
  }
  return different;
}

void run_rays(std::vector<Competitor>& competitors, const std::vector<Ray>& rays, int rounds) {
  const std::size_t chunk_count = (rays.size() + kChunk - 1) / kChunk;
  std::vector<Hit> first(kChunk), hits(kChunk);
  for (Competitor& competitor : competitors) competitor.chunk_times.assign(chunk_count, {}), competitor.different = 0;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t chunk = 0; chunk < chunk_count; ++chunk) {
      const std::size_t begin = chunk * kChunk, count = std::min(kChunk, rays.size() - begin);
      const std::span<const Ray> part(rays.data() + begin, count);
      if (round == 0) competitors[0].closest(part, first.data());
      for (std::size_t turn = 0; turn < competitors.size(); ++turn) {
        Competitor& competitor = competitors[(turn + chunk + static_cast<std::size_t>(round)) % competitors.size()];
        const double start = thread_seconds();
        competitor.closest(part, hits.data());
        competitor.chunk_times[chunk].push_back(thread_seconds() - start);
        if (round == 0) competitor.different += count_different(first, hits, count);
      }
    }
  }
}

struct RayCost {
  double nodes = 0, triangles = 0;
};

RayCost cost_of(const Snapshot& snapshot, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  std::vector<RayCounts> counts(rays.size());
  trace_closest(snapshot, rays, hits, Cull::kNone, counts);
  RayCost cost;
  for (const RayCounts& count : counts) cost.nodes += count.nodes_visited, cost.triangles += count.primitives_tested;
  cost.nodes /= static_cast<double>(rays.size()), cost.triangles /= static_cast<double>(rays.size());
  return cost;
}

// Reports ----------------------------------------------------------------------------------------------------------

struct Report {
  std::string text;

  void add(const std::string& row) { text += (text.empty() ? "  {" : ",\n  {") + row + "}"; }
};

std::string labelled(const std::string& layout, std::size_t count, const std::string& kind, const std::string& name) {
  return "\"layout\": \"" + layout + "\", \"instances\": " + std::to_string(count) + ", \"kind\": \"" + kind +
         "\", \"competitor\": \"" + name + "\"";
}

void report_commits(const std::string& layout, std::size_t count, const std::vector<Competitor>& competitors,
                    int threads, Report& json) {
  for (const Competitor& competitor : competitors) {
    const double set = 1e3 * median(competitor.set_times), commit = 1e3 * median(competitor.commit_times);
    std::printf("%-5s %8zu commit  %-22s set %8.2f ms, commit %8.2f ms, %6.0f ns an instance in all\n", layout.c_str(),
                count, competitor.name.c_str(), set, commit, 1e6 * (set + commit) / static_cast<double>(count));
    json.add(labelled(layout, count, "commit", competitor.name) + ", \"threads\": " + std::to_string(threads) +
             ", \"set_ms\": " + std::to_string(set) + ", \"commit_ms\": " + std::to_string(commit));
  }
  std::fflush(stdout);
}

void report_stages(const TopLevelReport& top, Report& json, const std::string& layout, std::size_t count) {
  std::printf("      ours: placing %.2f, refit %.2f, build %.2f, clustering %.2f, collapse %.2f ms (%s; %s)\n",
              top.placing_milliseconds, top.refit_milliseconds, top.build_milliseconds, top.clustering_milliseconds,
              top.collapse_milliseconds, top.builder.c_str(), top.reason.c_str());
  json.add(labelled(layout, count, "stages", "ours") + ", \"placing_ms\": " + std::to_string(top.placing_milliseconds) +
           ", \"refit_ms\": " + std::to_string(top.refit_milliseconds) +
           ", \"build_ms\": " + std::to_string(top.build_milliseconds) +
           ", \"clustering_ms\": " + std::to_string(top.clustering_milliseconds) +
           ", \"collapse_ms\": " + std::to_string(top.collapse_milliseconds));
}

void report_rays(const std::string& layout, std::size_t count, const std::string& kind, std::size_t ray_count,
                 const std::vector<Competitor>& competitors, const RayCost& cost, Report& json) {
  std::vector<double> times;
  for (const Competitor& competitor : competitors) {
    double sum = 0;
    for (const auto& chunk : competitor.chunk_times) sum += lower_third(chunk);
    times.push_back(sum);
  }
  std::printf("%-5s %8zu %-8s", layout.c_str(), count, kind.c_str());
  for (std::size_t i = 0; i < competitors.size(); ++i) {
    const double rate = static_cast<double>(ray_count) / times[i] * 1e-6;
    std::printf(" %s %.3f M/s (%.3f, %zu)", competitors[i].name.c_str(), rate, times[0] / times[i],
                competitors[i].different);
    json.add(labelled(layout, count, kind, competitors[i].name) + ", \"mrays_per_second\": " + std::to_string(rate) +
             ", \"ratio\": " + std::to_string(times[0] / times[i]) + ", \"different_from_first\": " +
             std::to_string(competitors[i].different) + ", \"ray_count\": " + std::to_string(ray_count));
  }
  std::printf("  ours: %.2f nodes, %.2f triangles a ray\n", cost.nodes, cost.triangles);
  std::fflush(stdout);
}

// ------------------------------------------------------------------------------------------------------------------

Competitor embree_competitor(const std::string& name, const TriangleMesh& mesh, std::size_t count, int threads) {
  EmbreeInstances::Options options;
  options.device = "threads=" + std::to_string(threads);
  if (name.find("array") != std::string::npos) options.kind = EmbreeInstances::Kind::kArray;
  if (name.find("low") != std::string::npos) options.quality = RTC_BUILD_QUALITY_LOW, options.is_dynamic = true;
  const auto peer = std::make_shared<EmbreeInstances>(mesh, count, options);
  return {name,
          [peer](std::span<const Affine> maps) { peer->set_transforms(maps); },
          [peer] { peer->commit(); },
          [peer](std::span<const Ray> rays, Hit* hits) { peer->closest(rays, hits); },
          {},
          {},
          {},
          0};
}

Strategy parse_strategy(const std::string& name) {
  if (name == "auto") return Strategy::kAuto;
  if (name == "packets") return Strategy::kPackets;
  if (name == "stream") return Strategy::kStream;
  if (name == "single") return Strategy::kSingle;
  throw std::runtime_error("no strategy named " + name);
}

Competitor tracing_competitor(const Ours& ours, const std::string& name) {
  const Strategy strategy = parse_strategy(name);
  Competitor competitor;
  competitor.name = name == "auto" ? "ours" : "ours/" + name;
  competitor.closest = [&ours, strategy](std::span<const Ray> rays, Hit* hits) {
    trace_closest(ours.snapshot(), rays, std::span(hits, rays.size()), Cull::kNone, {}, strategy);
  };
  return competitor;
}

void bench(const Options& options, const TriangleMesh& mesh, const std::string& layout, std::size_t count,
           Report& json) {
  Aabb box;
  for (const Vec3f& p : mesh.positions) box.grow(p);
  const std::vector<Affine> placed[2] = {place_instances(layout, box, count, 1),
                                         place_instances(layout, box, count, 2)};
  ThreadPool pool(options.threads);
  std::vector<Competitor> competitors;
  for (const std::string& name : options.peers) {
    competitors.push_back(embree_competitor(name, mesh, count, options.threads));
  }
  Ours ours(mesh, placed[0], pool);
  competitors.push_back({"ours",
                         [&](std::span<const Affine> maps) { ours.set_transforms(maps); },
                         [&] { ours.commit(); },
                         {},
                         {},
                         {},
                         {},
                         0});
  for (Competitor& competitor : competitors) competitor.set(placed[0]), competitor.commit();
  if (options.wants("commit")) {
    run_commits(competitors, options, placed);
    report_commits(layout, count, competitors, options.threads, json);
    report_stages(ours.report().top_level, json, layout, count);
  }
  // Rays are cast with the first and ours alone.
  competitors.resize(1);
  for (const std::string& strategy : options.strategies) competitors.push_back(tracing_competitor(ours, strategy));
  const Aabb world = ours.snapshot().tlas.bounds();
  const std::vector<Ray> primary = primary_rays(world, View::kOutside, 640, 400);
  for (const std::string kind : {"primary", "diffuse"}) {
    if (!options.wants(kind.c_str())) continue;
    const std::vector<Ray> rays = kind == "primary" ? primary : bounces(ours.snapshot(), primary, length(box.extent()));
    run_rays(competitors, rays, options.rounds);
    report_rays(layout, count, kind, rays.size(), competitors, cost_of(ours.snapshot(), rays), json);
  }
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  using namespace perfect_bvh::bench;
  try {
    const Options options = parse(count, values);
    const perfect_bvh::TriangleMesh mesh = read_mesh(options.mesh);
    Report json;
    for (const std::string& layout : options.layouts) {
      for (const std::size_t instances : options.counts) bench(options, mesh, layout, instances, json);
    }
    if (!options.json.empty()) std::ofstream(options.json) << "[\n" << json.text << "\n]\n";
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
