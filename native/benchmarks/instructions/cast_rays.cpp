// Casts the same rays with each instruction set and strategy, between two calls of getppid. At these calls a plugin of
// the emulator (counter.c) prints the number of executed instructions. Exits with 1 if two answers differ.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <numbers>
#include <random>
#include <string>

#include "core/thread_pool.h"
#include "scene/scene.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::bench {
namespace {

constexpr int kWidth = 96, kHeight = 64;
constexpr std::size_t kRays = kWidth * kHeight;
constexpr const char* kStrategies[] = {"auto", "packets", "stream", "single"};

class Random {
 public:
  double next() { return static_cast<double>(engine_() >> 8) * 0x1p-24; }
  Vec3d direction() {
    const double around = 2 * std::numbers::pi * next(), z = 2 * next() - 1, radius = std::sqrt(1 - z * z);
    return {radius * std::cos(around), radius * std::sin(around), z};
  }

 private:
  std::mt19937 engine_{1};
};

// A sphere with bumps.
Mesh bumpy_sphere(int rows, int columns) {
  std::vector<Vec3f> positions;
  std::vector<Vec3<std::int32_t>> triangles;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double down = std::numbers::pi * i / rows, around = 2 * std::numbers::pi * j / columns;
      const double r = 1 + 0.1 * std::sin(7 * down) * std::sin(9 * around) + 0.02 * std::sin(31 * down + 17 * around);
      positions.push_back({static_cast<float>(r * std::sin(down) * std::cos(around)),
                           static_cast<float>(r * std::sin(down) * std::sin(around)),
                           static_cast<float>(r * std::cos(down))});
      if (i == rows) continue;
      const int a = i * columns + j, b = i * columns + (j + 1) % columns;
      triangles.push_back({a, a + columns, b + columns});
      triangles.push_back({a, b + columns, b});
    }
  }
  return make_mesh(std::span<const Vec3f>(positions), triangles, "bumpy_sphere");
}

// A tile of an image of 768 x 512 at the sphere's edge: some rays miss.
std::vector<Ray> camera_rays() {
  std::vector<Ray> rays(kRays);
  for (std::size_t i = 0; i < kRays; ++i) {
    const double x = static_cast<double>(i % kWidth) / (8 * kWidth),
                 y = static_cast<double>(i / kWidth) / (8 * kHeight);
    rays[i].origin = {0.3, -4, 0.8};
    rays[i].direction = {x + 0.14, 1.2, 0.66 * y - 0.3};
  }
  return rays;
}

// Rays from inside in all directions, and from all sides.
std::vector<Ray> scattered_rays() {
  Random random;
  std::vector<Ray> rays(kRays);
  for (std::size_t i = 0; i < kRays; ++i) {
    rays[i].origin = random.direction() * (i % 2 == 0 ? 0.8 : 2.4);
    rays[i].direction = random.direction();
    if (i % 2 != 0) rays[i].direction = rays[i].direction - rays[i].origin;
  }
  return rays;
}

std::shared_ptr<const Snapshot> commit(bool is_crowd) {
  Scene scene;
  Random random;
  std::vector<InstanceInput> instances;
  const auto mesh = scene.add_mesh(is_crowd ? bumpy_sphere(24, 32) : bumpy_sphere(128, 256), {}, Usage::kStatic);
  for (int i = 0; i < (is_crowd ? 200 : 1); ++i) {
    Affine place;
    if (is_crowd) {
      const double size = 0.05 + 0.2 * random.next();
      place.x = {size, 0.1 * random.next(), 0}, place.y = {0, size, 0.1 * random.next()}, place.z = {0, 0, size};
      place.translation = random.direction() * (1.5 * random.next());
    }
    instances.push_back({mesh, place, ~0u, {}});
  }
  scene.add_instances(instances);
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  return scene.snapshot();
}

struct Answers {
  std::vector<Hit> hits{kRays};
  std::vector<std::uint8_t> occluded = std::vector<std::uint8_t>(kRays);

  [[nodiscard]] bool operator==(const Answers& other) const {
    return std::memcmp(hits.data(), other.hits.data(), kRays * sizeof(Hit)) == 0 && occluded == other.occluded;
  }
};

Answers cast(const Snapshot& snapshot, const std::vector<Ray>& rays, bool any, Strategy strategy) {
  Answers answers;
  (void)getppid();
  if (any) {
    trace_any(snapshot.view, {rays.data(), kRays, Cull::kNone, nullptr, nullptr, answers.occluded.data()}, {strategy});
  } else {
    trace_closest(snapshot.view, {rays.data(), kRays, Cull::kNone, nullptr, answers.hits.data(), nullptr}, {strategy});
  }
  (void)getppid();
  return answers;
}

// Prints "cast SCENE RAYS QUERY STRATEGY ISA"; the plugin prints the rest.
bool cast_with_all(const char* scene, const Snapshot& snapshot, const char* kind, const std::vector<Ray>& rays) {
  bool are_same = true;
  for (const bool any : {false, true}) {
    for (unsigned strategy = 0; strategy < 4; ++strategy) {
      std::vector<Answers> answers;
      for (const KernelTable* table : available_kernels()) {
        set_active_kernels(table->name);
        std::fprintf(stderr, "cast %s %s %s %s %s\n", scene, kind, any ? "any" : "closest", kStrategies[strategy],
                     table->name);
        answers.push_back(cast(snapshot, rays, any, static_cast<Strategy>(strategy)));
        are_same = are_same && answers.back() == answers.front();
      }
    }
  }
  return are_same;
}

}  // namespace
}  // namespace perfect_bvh::bench

int main() {
  using namespace perfect_bvh;
  using namespace perfect_bvh::bench;
  std::fprintf(stderr, "rays %zu\n", kRays);
  bool are_same = true;
  for (const bool is_crowd : {false, true}) {
    const char* const scene = is_crowd ? "instances" : "default";
    const auto snapshot = commit(is_crowd);
    are_same = cast_with_all(scene, *snapshot, "camera", camera_rays()) && are_same;
    are_same = cast_with_all(scene, *snapshot, "scattered", scattered_rays()) && are_same;
  }
  if (!are_same) std::fprintf(stderr, "the answers differ\n");
  return are_same ? 0 : 1;
}
