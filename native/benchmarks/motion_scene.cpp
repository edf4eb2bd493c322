#include "motion_scene.h"

#include <fstream>
#include <stdexcept>

#include "our_rays.h"
#include "query/trace.h"
#include "scene/scene.h"
#include "tlas/turns.h"

namespace perfect_bvh::bench {
namespace {

template <class T>
std::vector<T> read_rows(std::ifstream& file, std::size_t count) {
  std::vector<T> rows(count);
  file.read(reinterpret_cast<char*>(rows.data()), static_cast<std::streamsize>(count * sizeof(T)));
  if (!file) throw std::runtime_error("the scene's file ends too soon");
  return rows;
}

MotionScene::Shapes read_shapes(std::ifstream& file) {
  const auto counts = read_rows<std::uint32_t>(file, 3);
  MotionScene::Shapes shapes;
  for (std::uint32_t step = 0; step < counts[0]; ++step) shapes.steps.push_back(read_rows<Vec3f>(file, counts[1]));
  shapes.triangles = read_rows<TriangleIndices>(file, counts[2]);
  return shapes;
}

Turns turns_of(const MotionScene::Placed& placed, const StepTimes& times) {
  Turns turns;
  turns.times = times;
  for (const Affine& step : placed.steps) {
    if (!turns.add(step)) throw std::runtime_error("an instance is flattened");
  }
  return turns;
}

std::vector<Vec3f> positions_at(const MotionScene::Shapes& shapes, const Moment& moment) {
  std::vector<Vec3f> positions = shapes.steps[moment.step];
  if (!moment.is_between()) return positions;
  const std::vector<Vec3f>& later = shapes.steps[moment.step + 1];
  for (std::size_t i = 0; i < positions.size(); ++i) {
    Vec3f& at = positions[i];
    at = {interpolate(moment, at.x, later[i].x), interpolate(moment, at.y, later[i].y),
          interpolate(moment, at.z, later[i].z)};
  }
  return positions;
}

void add_meshes(Scene& scene, const MotionScene& from) {
  for (const MotionScene::Shapes& shapes : from.meshes) {
    Mesh mesh;
    mesh.positions.assign(shapes.steps[0].begin(), shapes.steps[0].end());
    mesh.triangles = AlignedVector<TriangleIndices>(shapes.triangles.begin(), shapes.triangles.end());
    const std::int32_t id = scene.add_mesh(std::move(mesh), BuildConfig{}, Usage::kStatic);
    if (shapes.steps.size() < 2) continue;
    std::vector<Vec3f> all;
    for (const std::vector<Vec3f>& step : shapes.steps) all.insert(all.end(), step.begin(), step.end());
    scene.set_mesh_motion(id, std::span<const Vec3f>(all), from.times());
  }
}

void add_instances(Scene& scene, const MotionScene& from) {
  std::vector<InstanceInput> inputs;
  for (const MotionScene::Placed& placed : from.instances) {
    inputs.push_back({static_cast<std::int32_t>(placed.mesh), placed.steps[0], ~0u, std::nullopt});
  }
  scene.add_instances(inputs);
  std::vector<std::int32_t> ids;
  for (std::size_t row = 0; row < from.instances.size(); ++row) {
    if (from.instances[row].moves) ids.push_back(static_cast<std::int32_t>(row));
  }
  if (ids.empty()) return;
  std::vector<double> entries;
  for (std::uint32_t step = 0; step < from.step_count; ++step) {
    for (const std::int32_t id : ids) {
      const Affine& map = from.instances[static_cast<std::size_t>(id)].steps[step];
      for (int row = 0; row < 3; ++row) {
        entries.insert(entries.end(), {map.x[row], map.y[row], map.z[row], map.translation[row]});
      }
    }
  }
  scene.set_instance_motion(ids, Matrices<double>{entries.data(), ids.size() * from.step_count, 3}, from.times());
}

// Finds where a ray bounces off the hit of a primary ray; false on a miss.
struct Bounce {
  Vec3d origin, normal;
};
bool find_bounce(Bounce& bounce, const Snapshot& scene, const Ray& ray, const Hit& hit, double gap) {
  if (!hit.found()) return false;
  Vec3d normal = normalized(world_triangle(scene, hit, ray.time).scaled_normal());
  if (!(dot(normal, normal) > 0.5)) return false;
  if (dot(normal, ray.direction) > 0) normal = -normal;
  bounce = {ray.origin + ray.direction * static_cast<double>(hit.t) + normal * gap, normal};
  return true;
}

}  // namespace

MotionScene MotionScene::frozen(float time) const {
  MotionScene still;
  still.step_count = 1;
  for (const Shapes& shapes : meshes) {
    const Moment moment = shapes.steps.size() < 2 ? Moment{} : moment_at(times(), time);
    still.meshes.push_back({{positions_at(shapes, moment)}, shapes.triangles});
  }
  for (const Placed& placed : instances) {
    const Affine map = placed.moves ? turns_of(placed, times()).at(time) : placed.steps[0];
    still.instances.push_back({placed.mesh, false, {map}});
  }
  return still;
}

MotionScene read_motion_scene(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const auto counts = read_rows<std::uint32_t>(file, 3);
  MotionScene scene;
  scene.step_count = counts[0];
  for (std::uint32_t i = 0; i < counts[1]; ++i) scene.meshes.push_back(read_shapes(file));
  const auto meshes = read_rows<std::uint32_t>(file, counts[2]), moves = read_rows<std::uint32_t>(file, counts[2]);
  for (std::uint32_t i = 0; i < counts[2]; ++i) scene.instances.push_back({meshes[i], moves[i] != 0, {}});
  for (std::uint32_t step = 0; step < scene.step_count; ++step) {
    for (MotionScene::Placed& placed : scene.instances) {
      const auto entries = read_rows<float>(file, 12);
      placed.steps.push_back(Matrices<float>{entries.data(), 1, 3}[0]);
    }
  }
  return scene;
}

std::shared_ptr<const Snapshot> committed(const MotionScene& scene) {
  ThreadPool pool(1);
  CancelToken cancel;
  Scene made;
  add_meshes(made, scene);
  add_instances(made, scene);
  made.commit(pool, cancel, {});
  return made.snapshot();
}

std::vector<MotionRays> make_motion_rays(const Snapshot& moving, const Snapshot& frozen, View view, std::uint32_t width,
                                         std::uint32_t height) {
  MotionRays primary{{"primary", {false, true}, {}}, {"primary", {false, true}, {}}};
  MotionRays diffuse{{"diffuse", {false, false}, {}}, {"diffuse", {false, false}, {}}};
  MotionRays occlusion{{"occlusion", {true, false}, {}}, {"occlusion", {true, false}, {}}};
  std::mt19937 random(11);
  primary.moving.rays = primary.frozen.rays = primary_rays(frozen.bounds, view, width, height);
  for (Ray& ray : primary.moving.rays) ray.time = static_cast<float>(random() >> 8) * 0x1p-24f;
  std::vector<Hit> hits(primary.moving.rays.size()), still_hits(hits.size());
  trace_closest(moving, primary.moving.rays, hits);
  trace_closest(frozen, primary.frozen.rays, still_hits);
  const auto diagonal = static_cast<double>(length(frozen.bounds.extent()));
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Ray &ray = primary.moving.rays[i], &still_ray = primary.frozen.rays[i];
    Bounce bounce, still;
    if (!find_bounce(bounce, moving, ray, hits[i], 1e-4 * diagonal)) continue;
    if (!find_bounce(still, frozen, still_ray, still_hits[i], 1e-4 * diagonal)) continue;
    for (MotionRays* kind : {&diffuse, &occlusion}) {
      std::mt19937 same(random());
      std::mt19937 again = same;
      kind->moving.rays.push_back(diffuse_ray(bounce.origin, bounce.normal, same));
      kind->moving.rays.back().time = ray.time;
      kind->frozen.rays.push_back(diffuse_ray(still.origin, still.normal, again));
    }
    for (RaySet* set : {&occlusion.moving, &occlusion.frozen}) {
      set->rays.back().t_max = static_cast<float>(0.1 * diagonal);
    }
  }
  return {primary, diffuse, occlusion};
}

}  // namespace perfect_bvh::bench
