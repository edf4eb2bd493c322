// time_bench [options] SCENE.bin
//   --rounds N  interleaved rounds (5)                 --kinds a,b  of primary,diffuse,occlusion (all)
// --size WxH  of the image (640x400)                 --inside     the camera is inside the box
// --isa NAME  of our kernels (the best)              --visits     count what our rays visit, in another run
//   --peers a,b of embree, ours, embree still, ours still, ours still with times (all)
// --json OUT.json  --noisy  measure at any load
//
// Measures a scene that moves within the shutter (motion_scene.h), with rays at random times: Embree's motion blur and
// ours. It also measures the scene frozen half-way with rays of the same kind: Embree, ours, and ours where rays have
// times but nothing moves. All take turns (ray_race.h) on one thread; competitors on the frozen scene have separate
// rays.
#include <algorithm>
#include <memory>
#include <stdexcept>

#include "arguments.h"
#include "embree_motion.h"
#include "embree_rays.h"
#include "json.h"
#include "motion_scene.h"
#include "our_rays.h"
#include "program.h"
#include "ray_race.h"

namespace perfect_bvh::bench {
namespace {

const std::vector<std::string> kPeers = {"embree", "ours", "embree still", "ours still", "ours still with times"};

struct Options : CommonOptions {
  std::vector<std::string> kinds, peers = kPeers;
  std::string isa, path;
  View view = View::kFilling;
  bool counts_visits = false;
};

void set(Options& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (set_common(options, arguments)) return;
  if (name == "--kinds") {
    options.kinds = arguments.list();
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
  if (options.path.empty()) throw std::runtime_error("time_bench: no scene given");
  for (const std::string& peer : options.peers) {
    if (std::find(kPeers.begin(), kPeers.end(), peer) == kPeers.end()) {
      throw std::runtime_error("no peer is called " + peer + "; there are " + to_json(kPeers));
    }
  }
  return options;
}

// Replaces the rays of a race by its own rays, batch by batch: both sets have the same size.
class OwnRays : public RayCaster {
 public:
  OwnRays(std::shared_ptr<RayCaster> caster, std::vector<Ray> own, const std::vector<Ray>& given)
      : caster_(std::move(caster)), own_(std::move(own)), given_(given) {}

  void load(std::span<const Ray> rays, RayUse use) override {
    caster_->load(std::span(own_).subspan(static_cast<std::size_t>(rays.data() - given_.data()), rays.size()), use);
  }
  void cast() override { caster_->cast(); }
  void read(std::span<Hit> hits) const override { caster_->read(hits); }
  void read(std::span<std::uint8_t> occluded) const override { caster_->read(occluded); }

 private:
  const std::shared_ptr<RayCaster> caster_;
  const std::vector<Ray> own_;
  const std::vector<Ray>& given_;
};

struct Scenes {
  MotionScene scene, still_scene;
  std::shared_ptr<const Snapshot> moving, frozen;
  std::shared_ptr<const EmbreeMotion> embree, embree_still;

  explicit Scenes(const Options& options)
      : scene(read_motion_scene(options.path)),
        still_scene(scene.frozen(0.5f)),
        moving(committed(scene)),
        frozen(committed(still_scene)) {
    for (const std::string& peer : options.peers) {
      if (peer == "embree") embree = std::make_shared<const EmbreeMotion>(scene);
      if (peer == "embree still") embree_still = std::make_shared<const EmbreeMotion>(still_scene);
    }
  }

  [[nodiscard]] std::shared_ptr<RayCaster> caster(const std::string& peer, const MotionRays& rays,
                                                  const std::string& isa) const {
    const auto embree_of = [](const std::shared_ptr<const EmbreeMotion>& made) {
      return std::make_shared<EmbreeRays>(made, made->scene(), EmbreeInstanceIds::kEither);
    };
    if (peer == "embree") return embree_of(embree);
    if (peer == "ours") return std::make_shared<OurRays>(moving, isa);
    std::vector<Ray> own = rays.frozen.rays;
    if (peer == "ours still with times") {
      for (std::size_t i = 0; i < own.size(); ++i) own[i].time = rays.moving.rays[i].time;
    }
    const std::shared_ptr<RayCaster> still = peer == "embree still"
                                                 ? std::shared_ptr<RayCaster>(embree_of(embree_still))
                                                 : std::make_shared<OurRays>(frozen, isa);
    return std::make_shared<OwnRays>(still, std::move(own), rays.moving.rays);
  }
};

std::vector<std::string> race_kind(const Scenes& scenes, const MotionRays& rays, const Options& options) {
  std::vector<RayCompetitor> competitors;
  for (const std::string& peer : options.peers) competitors.push_back({peer, scenes.caster(peer, rays, options.isa)});
  const auto diagonal = static_cast<double>(length(scenes.frozen->bounds.extent()));
  const std::vector<RaceResult> results = race(rays.moving, competitors, {options.rounds, kBatch, diagonal});
  std::vector<std::string> rows;
  for (std::size_t i = 0; i < competitors.size(); ++i) {
    JsonObject row;
    row.add("rays", rays.moving.name).add("competitor", competitors[i].name);
    row.add("ray_count", rays.moving.rays.size());
    row.add("mrays_per_second", results[i].mrays_per_second).add("rounds", results[i].rounds);
    if (competitors[i].name == "ours" && competitors[0].name == "embree") {
      row.add("different_from_first", results[i].agreement.different);
      row.add("other_triangle_than_first", results[i].agreement.other_triangle);
    }
    if (options.counts_visits && competitors[i].name.starts_with("ours")) {
      const bool is_still = competitors[i].name != "ours";
      const Visits visits =
          is_still ? count_visits(*scenes.frozen, rays.frozen) : count_visits(*scenes.moving, rays.moving);
      row.add("nodes_visited", visits.nodes).add("primitives_tested", visits.triangles);
    }
    rows.push_back(row.text());
  }
  return rows;
}

std::string bench(const Options& options) {
  const Scenes scenes(options);
  std::vector<std::string> rows;
  for (const MotionRays& rays :
       make_motion_rays(*scenes.moving, *scenes.frozen, options.view, options.width, options.height)) {
    const auto& kinds = options.kinds;
    if (!kinds.empty() && std::find(kinds.begin(), kinds.end(), rays.moving.name) == kinds.end()) continue;
    if (rays.moving.rays.empty()) continue;
    const std::vector<std::string> more = race_kind(scenes, rays, options);
    rows.insert(rows.end(), more.begin(), more.end());
  }
  return JsonObject().add("top_level_steps", scenes.moving->top_steps.size()).add_raw("rays", to_json(rows)).text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
