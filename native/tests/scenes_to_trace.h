// Meshes, placements and rays of every difficult kind, for comparisons with tests/reference_trace.h.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::test {

using Random = std::mt19937;
using Triangle = Vec3<std::int32_t>;

inline float uniform(Random& random, float low, float high) {
  return low + (high - low) * (static_cast<float>(random() >> 8) * 0x1p-24f);
}

inline Vec3f random_point(Random& random, float size) {
  return {uniform(random, -size, size), uniform(random, -size, size), uniform(random, -size, size)};
}

struct MeshData {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;

  void add(Vec3f a, Vec3f b, Vec3f c) {
    const auto first = static_cast<std::int32_t>(positions.size());
    positions.insert(positions.end(), {a, b, c});
    triangles.push_back({first, first + 1, first + 2});
  }
  [[nodiscard]] Mesh mesh(float scale = 1.0f) const {
    std::vector<Vec3f> scaled = positions;
    for (Vec3f& p : scaled) p = p * scale;
    return make_mesh(std::span<const Vec3f>(scaled), triangles, "test");
  }
};

inline MeshData soup(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f at = random_point(random, 1.0f);
    data.add(at + random_point(random, 0.2f), at + random_point(random, 0.2f), at + random_point(random, 0.2f));
  }
  return data;
}

// Needles along random lines, most of them so thin that float cannot represent their width.
inline MeshData slivers(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = random_point(random, 1.0f), b = random_point(random, 1.0f);
    const float width = std::ldexp(1.0f, -static_cast<int>(random() % 26));
    data.add(a, b, (a + b) * 0.5f + random_point(random, width));
  }
  return data;
}

// A closed, regular surface: shared vertices, coplanar neighbours, axis-parallel edges.
inline MeshData box_of_grids(std::int32_t cells) {
  MeshData data;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const auto first = static_cast<std::int32_t>(data.positions.size());
      for (std::int32_t i = 0; i <= cells; ++i) {
        for (std::int32_t j = 0; j <= cells; ++j) {
          Vec3f p{};
          p[axis] = side == 0 ? -1.0f : 1.0f;
          p[(axis + 1) % 3] = -1.0f + 2.0f * static_cast<float>(i) / static_cast<float>(cells);
          p[(axis + 2) % 3] = -1.0f + 2.0f * static_cast<float>(j) / static_cast<float>(cells);
          data.positions.push_back(p);
        }
      }
      for (std::int32_t i = 0; i < cells; ++i) {
        for (std::int32_t j = 0; j < cells; ++j) {
          const std::int32_t a = first + i * (cells + 1) + j, b = a + cells + 1;
          data.triangles.push_back({a, b, b + 1});
          data.triangles.push_back({a, b + 1, a + 1});
        }
      }
    }
  }
  return data;
}

// Each triangle several times, in every winding and order, and degenerate ones between them.
inline MeshData coincident(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = random_point(random, 1.0f), b = random_point(random, 1.0f), c = random_point(random, 1.0f);
    data.add(a, b, c), data.add(a, b, c), data.add(b, c, a), data.add(c, b, a);
    data.add(a, a, b), data.add(a, a, a), data.add(a, b, (a + b) * 0.5f);
  }
  return data;
}

inline std::vector<Ray> random_rays(std::size_t count, std::uint32_t seed, double scale = 1.0) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Vec3f origin = random_point(random, 2.0f), target = random_point(random, 1.0f);
    ray.origin = to_double(origin) * scale;
    ray.direction = to_double(target - origin) * scale;
    const auto kind = random() % 8;
    if (kind == 0) ray.direction.x = 0.0;
    if (kind == 1) ray.direction.y = -0.0, ray.direction.z = 0.0;
    if (kind == 2) ray.t_min = 0.25f, ray.t_max = uniform(random, 0.25f, 2.0f);
    if (kind == 3) ray.mask = random() & 7;
  }
  return rays;
}

// Rays from inside a mesh at its vertices and points of its edges.
inline std::vector<Ray> aimed_rays(const MeshData& data, std::size_t count, std::uint32_t seed) {
  Random random(seed);
  std::vector<Ray> rays(count);
  for (Ray& ray : rays) {
    const Triangle t = data.triangles[random() % data.triangles.size()];
    const Vec3f a = data.positions[static_cast<std::size_t>(t.x)], b = data.positions[static_cast<std::size_t>(t.y)];
    const Vec3f origin = random_point(random, 0.5f);
    const Vec3f target = random() % 2 ? a : a + (b - a) * uniform(random, 0.0f, 1.0f);
    ray.origin = to_double(origin);
    ray.direction = to_double(target - origin);
  }
  return rays;
}

struct Placed {
  MeshData mesh;
  std::vector<Affine> places;
};

inline std::shared_ptr<const Snapshot> commit(const std::vector<Placed>& parts, float scale = 1.0f,
                                              const BuildConfig& config = {}) {
  Scene scene;
  std::uint32_t mask = 1;
  for (const Placed& part : parts) {
    const std::int32_t mesh = scene.add_mesh(part.mesh.mesh(scale), config, Usage::kStatic);
    std::vector<InstanceInput> inputs;
    for (Affine place : part.places) {
      place.translation = place.translation * static_cast<double>(scale);
      inputs.push_back({mesh, place, mask, {}});
      mask = mask == 4 ? 1 : mask * 2;
    }
    scene.add_instances(inputs);
  }
  ThreadPool pool(1);
  CancelToken cancel;
  scene.commit(pool, cancel);
  return scene.snapshot();
}

inline std::vector<Affine> many_places(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  std::vector<Affine> places(count);
  for (Affine& place : places) {
    const auto column = [&] { return to_double(random_point(random, 1.0f)); };
    place = {column(), column(), column(), to_double(random_point(random, 3.0f))};
    if (random() % 4 == 0) place.x = place.x * 1e-3;
    if (random() % 4 == 0) place = {{0.1, 0, 0}, {0, 0.1, 0}, {0, 0, -0.1}, place.translation};
  }
  return places;
}

// Triangles that each span all of the shared space.
inline MeshData wide_soup(std::size_t count, std::uint32_t seed) {
  Random random(seed);
  MeshData data;
  for (std::size_t i = 0; i < count; ++i) {
    data.add(random_point(random, 1.0f), random_point(random, 1.0f), random_point(random, 1.0f));
  }
  return data;
}

inline std::vector<std::string> kernel_names() {
  std::vector<std::string> names;
  for (const KernelTable* table : available_kernels()) names.push_back(table->name);
  return names;
}

// Runs every test with all kernels.
class KernelTest : public testing::TestWithParam<std::string> {
 public:
  static std::string name_of(const testing::TestParamInfo<std::string>& test) { return test.param; }

 protected:
  void SetUp() override { set_active_kernels(GetParam()); }
  void TearDown() override { set_active_kernels(""); }
};

}  // namespace perfect_bvh::test
