// Sets of boxes to test builders on, ordinary and hard; all from fixed seeds.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "builders/bvh2.h"

namespace perfect_bvh::test {

inline PrimRef make_ref(Vec3f lower, Vec3f upper, std::size_t index) {
  return {lower, static_cast<std::uint32_t>(index), upper, 0};
}

inline std::vector<PrimRef> repeated(std::size_t count, Vec3f lower, Vec3f upper) {
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) refs.push_back(make_ref(lower, upper, i));
  return refs;
}

// Small boxes at random positions in a cube.
inline std::vector<PrimRef> scattered(std::size_t count, std::uint32_t seed = 1, float scale = 1.0f,
                                      float offset = 0.0f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f), size(0.0f, 0.02f);
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f lower = Vec3f{place(random), place(random), place(random)} * scale + Vec3f{offset, offset, offset};
    const Vec3f upper = lower + Vec3f{size(random), size(random), size(random)} * scale;
    refs.push_back(make_ref(lower, upper, i));
  }
  return refs;
}

// The boxes of a bumpy sheet's triangles, as a builder gets them from a mesh.
inline std::vector<PrimRef> sheet(std::size_t side) {
  const auto point = [side](std::size_t x, std::size_t y) {
    const float u = static_cast<float>(x) / static_cast<float>(side),
                v = static_cast<float>(y) / static_cast<float>(side);
    return Vec3f{u, v, 0.1f * std::sin(17.0f * u) * std::cos(13.0f * v)};
  };
  std::vector<PrimRef> refs;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      const Vec3f a = point(x, y), b = point(x + 1, y), c = point(x, y + 1), d = point(x + 1, y + 1);
      refs.push_back(make_ref(min(min(a, b), c), max(max(a, b), c), refs.size()));
      refs.push_back(make_ref(min(min(b, c), d), max(max(b, c), d), refs.size()));
    }
  }
  return refs;
}

// A huge flat box under many small ones, which misleads greedy object splits.
inline std::vector<PrimRef> ground_and_pebbles(std::size_t count) {
  auto refs = scattered(count);
  refs.push_back(make_ref({-1000.0f, -1000.0f, -0.01f}, {1000.0f, 1000.0f, 0.0f}, refs.size()));
  return refs;
}

// Boxes inside boxes. Concentric ones share one centroid. Cornered ones are halved towards the origin down to the
// smallest float, then start again: each plane separates at most a few.
inline std::vector<PrimRef> concentric(std::size_t count) {
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const float size = static_cast<float>(i + 1);
    refs.push_back(make_ref({-size, -size, -size}, {size, size, size}, i));
  }
  return refs;
}
inline std::vector<PrimRef> cornered(std::size_t count, int step = 1) {
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const float size = std::ldexp(1.0f, 60 - static_cast<int>(i) * step % 180);
    refs.push_back(make_ref({0.0f, 0.0f, 0.0f}, {size, size, size}, i));
  }
  return refs;
}

// Points on a line: every box, even the root's, has zero area.
inline std::vector<PrimRef> points_on_line(std::size_t count) {
  std::vector<PrimRef> refs;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f point{static_cast<float>(i), 0.0f, 0.0f};
    refs.push_back(make_ref(point, point, i));
  }
  return refs;
}

inline std::vector<PrimRef> with_zeros_of_both_signs(std::size_t count) {
  auto refs = scattered(count, 11);
  for (std::size_t i = 0; i < refs.size(); ++i) {
    refs[i].lower.x = i % 2 == 0 ? 0.0f : -0.0f;
    refs[i].upper.x = i % 3 == 0 ? 0.0f : -0.0f;
  }
  return refs;
}

struct NamedSet {
  const char* name;
  std::vector<PrimRef> refs;
};

// Input that every builder must turn into a sound tree, in bounded time and memory.
inline std::vector<NamedSet> hard_sets() {
  const float huge = 3e38f;
  std::vector<NamedSet> sets;
  for (std::size_t count : {1u, 2u, 3u, 4u, 5u, 9u}) sets.push_back({"few", scattered(count)});
  for (std::size_t count : {2u, 8u, 9u, 100u}) sets.push_back({"identical", repeated(count, {0, 0, 0}, {1, 1, 1})});
  sets.push_back({"100000 duplicates", repeated(100000, {1, 2, 3}, {2, 3, 4})});
  sets.push_back({"30000 points in one place", repeated(30000, {1, 2, 3}, {1, 2, 3})});
  sets.push_back({"points on a line", points_on_line(20000)});
  sets.push_back({"ground and pebbles", ground_and_pebbles(20000)});
  sets.push_back({"concentric", concentric(30000)});
  sets.push_back({"cornered", cornered(30000)});
  sets.push_back({"cornered, coarse", cornered(20000, 7)});
  sets.push_back({"scale 1e-6", scattered(5000, 3, 1e-6f)});
  sets.push_back({"scale 1e-20", scattered(5000, 4, 1e-20f)});
  sets.push_back({"denormal", scattered(5000, 5, 1e-40f)});
  sets.push_back({"scale 1e8", scattered(5000, 6, 1e8f)});
  sets.push_back({"scale 1e20", scattered(5000, 7, 1e20f)});
  sets.push_back({"scale 1e38", scattered(5000, 8, 1e38f)});
  sets.push_back({"offset 1e6", scattered(5000, 9, 1.0f, 1e6f)});
  auto overflowing = scattered(1000, 10, 1.0f);
  overflowing.push_back(make_ref({-huge, -huge, -huge}, {huge, huge, huge}, overflowing.size()));
  overflowing.push_back(make_ref({huge, huge, huge}, {huge, huge, huge}, overflowing.size()));
  overflowing.push_back(make_ref({-huge, 0, 0}, {-huge, 0, 0}, overflowing.size()));
  sets.push_back({"near the largest float", overflowing});
  sets.push_back({"zeros of both signs", with_zeros_of_both_signs(5000)});
  return sets;
}

}  // namespace perfect_bvh::test
