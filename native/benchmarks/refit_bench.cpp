// refit_bench [options] MESH.bin
//   --threads N      of both sides, for updates (1)      --rounds N         interleaved rounds (9)
//   --twists a,b     radians from end to end (0.1,1.5,6.2831853)
//   --ray-rounds N   interleaved rounds of rays; 0: none (5)
//   --size WxH       of the image that primary rays make (640x400)
//   --json OUT.json
//
// Refit: a mesh that sways; every competitor in turn, the order rotating from round to round, each from the frame's
// positions in memory to a scene ready to trace. With one thread the time is the thread's own CPU time, otherwise that
// of the wall clock. Twists: the mesh twisted about its longest axis, in one step from the tree of the mesh at rest;
// what each update takes, and the rays per second through what it leaves (see ray_race.h; always on one thread).
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <stdexcept>

#include "embree_peer.h"
#include "embree_refit.h"
#include "json.h"
#include "ray_race.h"
#include "ray_sets.h"
#include "scene/blas_build.h"
#include "scene/instance_placing.h"
#include "scene/scene.h"
#include "scene/top_level.h"
#include "scene/trace.h"
#include "scene/trace_view.h"
#include "wide/collapse.h"
#include "wide/wide_cost.h"
#include "wide/wide_rebuild.h"
#include "wide/wide_refit.h"
#include "wide/wide_rotation.h"

namespace perfect_bvh::bench {
namespace {

struct Options {
  int threads = 1, rounds = 9, ray_rounds = 5;
  std::vector<float> twists{0.1f, 1.5f, 6.2831853f};
  std::uint32_t width = 640, height = 400;
  std::string json, mesh;
};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

Options parse(int count, char** values) {
  Options options;
  for (int i = 1; i < count; ++i) {
    const std::string name = values[i];
    const auto value = [&] {
      if (++i >= count) throw std::runtime_error(name + " needs a value");
      return std::string(values[i]);
    };
    if (name == "--threads") {
      options.threads = std::stoi(value());
    } else if (name == "--rounds") {
      options.rounds = std::stoi(value());
    } else if (name == "--ray-rounds") {
      options.ray_rounds = std::stoi(value());
    } else if (name == "--twists") {
      options.twists.clear();
      for (const std::string& part : split(value(), ',')) options.twists.push_back(std::stof(part));
    } else if (name == "--size") {
      const auto parts = split(value(), 'x');
      options.width = static_cast<std::uint32_t>(std::stoul(parts.at(0)));
      options.height = static_cast<std::uint32_t>(std::stoul(parts.at(1)));
    } else if (name == "--json") {
      options.json = value();
    } else {
      options.mesh = name;
    }
  }
  if (options.mesh.empty()) throw std::runtime_error("refit_bench: no mesh given");
  return options;
}

// Motions ----------------------------------------------------------------------------------------------------------

using Positions = AlignedVector<Vec3f>;

Aabb bounds_of_positions(const Positions& positions) {
  Aabb box;
  for (const Vec3f& position : positions) box.grow(position);
  return box;
}

int longest_axis(const Aabb& box) {
  const Vec3f e = box.extent();
  return e.x >= e.y ? (e.x >= e.z ? 0 : 2) : (e.y >= e.z ? 1 : 2);
}

Positions twisted(Positions positions, float radians) {
  const Aabb box = bounds_of_positions(positions);
  const int axis = longest_axis(box), u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vec3f centre = (box.lower + box.upper) * 0.5f;
  for (Vec3f& p : positions) {
    const float turn = radians * ((p[axis] - box.lower[axis]) / box.extent()[axis]);
    const float c = std::cos(turn), s = std::sin(turn), x = p[u] - centre[u], y = p[v] - centre[v];
    p[u] = centre[u] + c * x - s * y;
    p[v] = centre[v] + s * x + c * y;
  }
  return positions;
}

// By a fiftieth of the mesh's length.
Positions swayed(Positions positions, int frame) {
  const Aabb box = bounds_of_positions(positions);
  const int axis = longest_axis(box), u = (axis + 1) % 3;
  const float length = box.extent()[axis], phase = 0.7f * static_cast<float>(frame);
  for (Vec3f& p : positions) p[u] += 0.02f * length * std::sin(phase + 6.0f * (p[axis] - box.lower[axis]) / length);
  return positions;
}

TriangleMesh with(const TriangleMesh& mesh, Positions positions) {
  TriangleMesh result = mesh;
  result.positions = std::move(positions);
  return result;
}

// Refits -----------------------------------------------------------------------------------------------------------

struct Competitor {
  std::string name;
  std::function<double(const Positions&)> move;  // seconds
  std::vector<double> nanoseconds;               // a triangle, of each round
};

// The tree alone, into memory that a tree of the same shape leaves, as a scene does it in the long run.
Competitor our_refit(const TriangleMesh& mesh, int thread_count) {
  struct State {
    TriangleMesh mesh;
    ThreadPool pool;
    WideBvh trees[2];
    std::size_t now = 0;
  };
  const std::shared_ptr<State> state(new State{mesh, ThreadPool(thread_count), {}, 0});
  CancelToken cancel;
  const BuildConfig config = choose_builder({}, Usage::kDeforming);
  const Bvh2 tree = build_tree(mesh, config, state->pool, cancel);
  for (WideBvh& wide : state->trees) wide = collapse_mesh(tree, mesh, config.layout, state->pool, cancel);
  const auto move = [state, thread_count](const Positions& positions) {
    CancelToken token;
    state->mesh.positions = positions;
    const std::size_t next = 1 - state->now;
    const double start = seconds(thread_count);
    static_cast<void>(refit_wide(state->trees[state->now], state->mesh, state->trees[next], true, state->pool, token));
    const double taken = seconds(thread_count) - start;
    state->now = next;
    return taken;
  };
  return {"refit", move, {}};
}

// All of a commit: the copy of the positions too.
Competitor our_commit(const TriangleMesh& mesh, int thread_count) {
  struct State {
    ThreadPool pool;
    Scene scene;
    std::int32_t mesh_id = 0;
    explicit State(int threads) : pool(threads) {}
  };
  const auto state = std::make_shared<State>(thread_count);
  CancelToken cancel;
  state->mesh_id = state->scene.add_mesh(TriangleMesh(mesh), {}, Usage::kDeforming);
  state->scene.add_instances(std::vector<InstanceInput>{{state->mesh_id, Affine{}, ~0u, std::nullopt}});
  static_cast<void>(state->scene.commit(state->pool, cancel));
  const auto move = [state, thread_count](const Positions& positions) {
    CancelToken token;
    const double start = seconds(thread_count);
    state->scene.update_mesh<float>(state->mesh_id, positions);
    const CommitReport report = state->scene.commit(state->pool, token);
    const double taken = seconds(thread_count) - start;
    if (report.meshes.at(0).action != MeshAction::kRefitted) throw std::runtime_error("refit_bench: not refitted");
    return taken;
  };
  return {"update and commit", move, {}};
}

Competitor embree_refit(const TriangleMesh& mesh, int thread_count) {
  const auto peer = std::make_shared<EmbreeRefit>(mesh, thread_count);
  return {"embree_refit", [peer](const Positions& positions) { return peer->move(positions); }, {}};
}

std::vector<std::string> race_refits(const TriangleMesh& mesh, const Options& options) {
  std::vector<Competitor> competitors{our_refit(mesh, options.threads), our_commit(mesh, options.threads),
                                      embree_refit(mesh, options.threads)};
  constexpr int kWarmUp = 2;  // rounds, in which memory is handed out
  for (int round = -kWarmUp; round < options.rounds; ++round) {
    const Positions positions = swayed(mesh.positions, round + kWarmUp);
    for (std::size_t turn = 0; turn < competitors.size(); ++turn) {
      Competitor& competitor = competitors[(turn + static_cast<std::size_t>(round + kWarmUp)) % competitors.size()];
      const double taken = competitor.move(positions);
      if (round >= 0) {
        competitor.nanoseconds.push_back(1e9 * taken / static_cast<double>(mesh.triangle_count()));
      }
    }
  }
  std::vector<std::string> rows;
  for (const Competitor& competitor : competitors) {
    JsonObject row;
    row.add("name", competitor.name).add("ns_per_triangle", Spread::of(competitor.nanoseconds));
    rows.push_back(row.text());
  }
  return rows;
}

// Twists -----------------------------------------------------------------------------------------------------------

// A tree as a scene of one instance.
std::shared_ptr<const Snapshot> snapshot_over(TriangleMesh mesh, WideBvh wide) {
  ThreadPool pool(1);
  CancelToken cancel;
  auto blas = std::make_shared<Blas>(std::make_shared<const TriangleMesh>(std::move(mesh)));
  blas->wide = std::move(wide);
  blas->cover = make_cover(cover_boxes(blas->wide, blas->mesh, kCoverBoxes));
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->blases.push_back(blas);
  Instance& instance = snapshot->instances.emplace_back();
  instance.id = 0, instance.mesh_id = 0;
  Placing placing;
  if (!place_instance(instance, placing, *blas, Affine{})) throw std::runtime_error("refit_bench: no instance");
  const Aabb& box = placing.world_bounds;
  snapshot->instance_views.push_back(view_of(instance, placing.world_to_object));
  snapshot->tlas = build_top_level(std::vector<PrimRef>{{box.lower, 0, box.upper, 0}}, pool, cancel).tree;
  snapshot->top_level = collapse_top_level(snapshot->tlas, pool, cancel);
  make_trace_view(*snapshot, pool, cancel);
  return snapshot;
}

// The tree of the mesh at rest, brought to the mesh of now in one of several ways.
struct Update {
  std::string name;
  double ns_per_triangle = 0, cost = 0;  // cost: as make_blas compares it
  RayCompetitor traced;
};

RayCompetitor traced_by_us(const std::string& name, std::shared_ptr<const Snapshot> snapshot) {
  return {name,
          [snapshot](std::span<const Ray> rays, Hit* hits) {
            trace_closest(*snapshot, rays, std::span(hits, rays.size()));
          },
          [snapshot](std::span<const Ray> rays, std::uint8_t* occluded) {
            trace_occluded(*snapshot, rays, std::span(occluded, rays.size()));
          }};
}

class Twist {
 public:
  Twist(const TriangleMesh& rest, const TriangleMesh& mesh, const Options& options)
      : rest_(rest), mesh_(mesh), threads_(options.threads), pool_(options.threads) {}

  [[nodiscard]] std::vector<Update> run() {
    add("rebuild", [&](WideBvh& wide, WideCosts& costs) {
      wide = collapse_mesh(build_tree(mesh_, config_, pool_, cancel_), mesh_, config_.layout, pool_, cancel_);
      costs = measure_wide_costs(wide, pool_, cancel_);
    });
    const WideBvh still =
        collapse_mesh(build_tree(rest_, config_, pool_, cancel_), rest_, config_.layout, pool_, cancel_);
    const WideCosts fresh = measure_wide_costs(still, pool_, cancel_);
    const auto refit = [&](WideBvh& wide, WideCosts& costs) {
      costs = refit_wide(still, mesh_, wide, true, pool_, cancel_);
    };
    const auto rotate = [&](WideBvh& wide, WideCosts& costs) {
      static_cast<void>(rotate_wide(wide, costs, pool_, cancel_));
    };
    const auto rebuild_spoilt = [&](double tolerance) {
      return [&, tolerance](WideBvh& wide, WideCosts& costs) {
        refit(wide, costs);
        WideCosts compared = fresh;
        const auto parts = find_spoilt_parts(wide, costs, compared, tolerance);
        costs = rebuild_parts(wide, compared, parts, config_, pool_, cancel_);
      };
    };
    add("refit", refit, still);
    add("refit, rotations", [&](WideBvh& wide, WideCosts& costs) { refit(wide, costs), rotate(wide, costs); }, still);
    add(
        "refit, rotations 3 times",
        [&](WideBvh& wide, WideCosts& costs) {
          refit(wide, costs);
          for (int i = 0; i < 3; ++i) rotate(wide, costs);
        },
        still);
    add("spoilt parts rebuilt", rebuild_spoilt(1.1), still);
    add("rebuilt over its leaves", rebuild_spoilt(0.0), still);
    add_embree();
    return std::move(updates_);
  }

 private:
  template <class Make>
  void add(const std::string& name, const Make& make, WideBvh wide = {}) {
    WideCosts costs;
    const double start = seconds(threads_);
    make(wide, costs);
    const double taken = seconds(threads_) - start;
    const double cost = costs.whole(wide);
    updates_.push_back({name, per_triangle(taken), cost, traced_by_us(name, snapshot_over(mesh_, std::move(wide)))});
  }

  void add_embree() {
    const auto refitted = std::make_shared<EmbreeRefit>(rest_, threads_);
    updates_.push_back(
        {"embree_refit",
         per_triangle(refitted->move(mesh_.positions)),
         0,
         {"embree_refit", [refitted](std::span<const Ray> rays, Hit* hits) { refitted->closest(rays, hits); },
          [refitted](std::span<const Ray> rays, std::uint8_t* occluded) { refitted->any(rays, occluded); }}});
    const double start = seconds(threads_);
    const auto rebuilt = std::make_shared<EmbreePeer>(mesh_, EmbreePeer::Options{});
    updates_.push_back(
        {"embree_rebuild",
         per_triangle(seconds(threads_) - start),
         0,
         {"embree_rebuild", [rebuilt](std::span<const Ray> rays, Hit* hits) { rebuilt->closest(rays, hits); },
          [rebuilt](std::span<const Ray> rays, std::uint8_t* occluded) { rebuilt->any(rays, occluded); }}});
  }

  [[nodiscard]] double per_triangle(double taken) const {
    return 1e9 * taken / static_cast<double>(mesh_.triangle_count());
  }

  const TriangleMesh &rest_, &mesh_;
  int threads_;
  ThreadPool pool_;
  CancelToken cancel_;
  const BuildConfig config_ = choose_builder({}, Usage::kDeforming);
  std::vector<Update> updates_;
};

std::string race_twist(const TriangleMesh& rest, float radians, const Options& options) {
  const TriangleMesh mesh = with(rest, twisted(rest.positions, radians));
  const std::vector<Update> updates = Twist(rest, mesh, options).run();
  std::vector<RayCompetitor> competitors;
  std::vector<JsonObject> rows(updates.size());
  for (std::size_t i = 0; i < updates.size(); ++i) {
    competitors.push_back(updates[i].traced);
    rows[i].add("name", updates[i].name).add("ns_per_triangle", updates[i].ns_per_triangle);
    if (updates[i].cost > 0) rows[i].add("cost", updates[i].cost);
  }
  const Aabb box = bounds_of_positions(mesh.positions);
  const std::vector<Ray> primary = primary_rays(box, View::kOutside, options.width, options.height);
  std::vector<Hit> hits(primary.size());
  competitors.front().closest(primary, hits.data());
  for (const RaySet& set : make_ray_sets(mesh, box, View::kOutside, primary, hits)) {
    if ((set.name != "primary" && set.name != "diffuse") || set.rays.empty()) continue;
    const std::vector<RaceResult> results = race(set, competitors, options.ray_rounds);
    for (std::size_t i = 0; i < results.size(); ++i) {
      const std::string key = set.name + "_mrays_per_second";
      rows[i].add(key.c_str(), results[i].mrays_per_second);
    }
  }
  std::vector<std::string> texts;
  for (const JsonObject& row : rows) texts.push_back(row.text());
  return JsonObject().add("radians", static_cast<double>(radians)).add("updates", texts).text();
}

std::string bench(const Options& options, const TriangleMesh& mesh) {
  JsonObject result;
  result.add("triangle_count", mesh.triangle_count()).add("threads", options.threads);
  if (options.rounds > 0) result.add("refits", race_refits(mesh, options));
  std::vector<std::string> twists;
  for (const float radians : options.twists) {
    if (options.ray_rounds > 0) twists.push_back(race_twist(mesh, radians, options));
  }
  result.add("twists", twists);
  return result.text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  using namespace perfect_bvh::bench;
  try {
    const Options options = parse(count, values);
    const std::string json = bench(options, read_mesh(options.mesh));
    if (options.json.empty()) {
      std::printf("%s\n", json.c_str());
    } else if (!(std::ofstream(options.json) << json << "\n")) {
      throw std::runtime_error("cannot write " + options.json);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
