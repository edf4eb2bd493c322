// The order in which coherent rays are traced: when an order is found, how compact packets are in it, and that no
// answer depends on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>

#include "core/aligned.h"
#include "query/trace.h"
#include "tests/reference_trace.h"
#include "tests/scenes_to_trace.h"
#include "traverse/dispatch.h"
#include "traverse/ray_reordering.h"

namespace perfect_bvh::test {
namespace {

constexpr double kReach = 10.0;

// An image of a tilted camera, row by row.
std::vector<Ray> camera_rays(std::size_t width, std::size_t height, Vec3d eye = {0.2, 0.4, 6.0}, double field = 0.4) {
  const Vec3d forward = normalized(Vec3d{0, 0, 0} - eye), right = normalized(cross(forward, Vec3d{0.4, 1, 0.1}));
  const Vec3d up = cross(right, forward);
  const auto at = [](std::size_t i, std::size_t count) {
    return (static_cast<double>(i) + 0.5) / static_cast<double>(count) * 2 - 1;
  };
  const double aspect = static_cast<double>(height) / static_cast<double>(width);
  std::vector<Ray> rays;
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      Ray ray;
      ray.origin = eye;
      ray.direction = forward + right * (field * at(x, width)) + up * (field * aspect * at(y, height));
      rays.push_back(ray);
    }
  }
  return rays;
}

struct Reordered {
  std::vector<std::uint32_t> rows;  // empty: the rays keep their order

  explicit Reordered(std::span<const Ray> rays) {
    const auto space = std::make_unique<ReorderingSpace>();
    if (reorder_rays(rays, kReach, *space)) rows.assign(space->order, space->order + rays.size());
  }
  [[nodiscard]] bool holds_every_row_once() const {
    std::vector<std::uint32_t> sorted = rows, all(rows.size());
    std::sort(sorted.begin(), sorted.end());
    std::iota(all.begin(), all.end(), 0u);
    return sorted == all;
  }
};

TEST(RayReordering, MakesTilesOfRows) {
  for (const auto& [width, height] : {std::pair{640u, 16u}, {97u, 111u}, {1920u, 8u}, {128u, 128u}, {16u, 1000u}}) {
    const std::vector<Ray> rays = camera_rays(width, height);
    const Reordered order(rays);
    if (width == 16) {  // 64 rays of it are 16 x 4 pixels, which is compact enough
      EXPECT_TRUE(order.rows.empty());
      continue;
    }
    ASSERT_EQ(order.rows.size(), rays.size()) << width;
    EXPECT_TRUE(order.holds_every_row_once());
    std::size_t compact = 0, packets = rays.size() / 64;
    for (std::size_t packet = 0; packet < packets; ++packet) {
      std::uint32_t left = width, right = 0, top = height, bottom = 0;
      for (std::size_t i = 0; i < 64; ++i) {
        const std::uint32_t row = order.rows[64 * packet + i], x = row % width, y = row / width;
        left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
      }
      compact += right - left < 20 && bottom - top < 20 ? 1 : 0;
    }
    EXPECT_GT(compact, packets * 8 / 10) << width << " x " << height;
  }
}

TEST(RayReordering, FindsRaysInAnyOrderAndParallelOnes) {
  std::vector<Ray> rays = camera_rays(100, 100);
  std::shuffle(rays.begin(), rays.end(), Random(1));
  EXPECT_TRUE(Reordered(rays).holds_every_row_once());
  EXPECT_EQ(Reordered(rays).rows.size(), rays.size());
  // Towards a lamp, and towards the sun.
  std::vector<Ray> sun = rays;
  for (Ray& ray : rays) ray.origin = ray.origin + ray.direction, ray.direction = -ray.direction, ray.t_max = 1.0f;
  EXPECT_EQ(Reordered(rays).rows.size(), rays.size());
  for (Ray& ray : sun) ray.origin = ray.origin + ray.direction, ray.direction = {0.1, 0.2, -3.0};
  EXPECT_EQ(Reordered(sun).rows.size(), sun.size());
}

TEST(RayReordering, LeavesOtherRaysAlone) {
  const std::vector<Ray> rays = camera_rays(100, 100);
  EXPECT_TRUE(Reordered(random_rays(5000, 1)).rows.empty());
  EXPECT_TRUE(Reordered(std::span(rays).first(kLeastReordered - 1)).rows.empty());
  EXPECT_TRUE(Reordered(std::vector<Ray>(2000, rays[0])).rows.empty());
  // Its own result needs no reordering.
  const Reordered order(rays);
  std::vector<Ray> tiles;
  for (const std::uint32_t row : order.rows) tiles.push_back(rays[row]);
  EXPECT_TRUE(Reordered(tiles).rows.empty());
  // All around.
  std::vector<Ray> panorama = rays;
  for (std::size_t i = 0; i < panorama.size(); ++i) {
    const double angle = 0.01 * static_cast<double>(i);
    panorama[i].direction = {std::cos(angle), std::sin(angle), 0.1};
  }
  EXPECT_TRUE(Reordered(panorama).rows.empty());
}

// Some of them are invalid rays. Mixed: others go elsewhere.
std::vector<Ray> hard_rays(Vec3d eye, bool mixed) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double length = std::sqrt(dot(eye, eye));
  std::vector<Ray> rays = camera_rays(91, 23, eye, 2.0 / length);  // neither rows nor the whole fill packets exactly
  Random random(3);
  for (Ray& ray : rays) {
    const auto kind = random() % 40;
    if (kind == 0) ray.direction = {0, 0, 0};
    if (kind == 1) ray.direction.x = std::numeric_limits<double>::quiet_NaN();
    if (kind == 2) ray.origin.y = kInfinity;
    if (kind == 3 && mixed) ray.direction = ray.direction * 1e300;
    if (kind == 4 && mixed) ray.direction = ray.direction * 1e-300;
    if (kind == 5 && mixed) ray.direction = -ray.direction;
    if (kind == 6) ray.t_min = 2.0f, ray.t_max = 1.0f;
    if (kind > 30) ray.mask = random() & 7;
    if (kind > 6 && kind < 20) ray.t_max = static_cast<float>(length) * uniform(random, 0.7f, 1.2f);
    if (kind == 20 && mixed) ray = random_rays(1, static_cast<std::uint32_t>(random()))[0];
  }
  if (!mixed) return rays;
  for (const Ray& ray : random_rays(300, 4)) rays.push_back(ray);
  return rays;
}

class ReorderedRays : public KernelTest {};
INSTANTIATE_TEST_SUITE_P(All, ReorderedRays, testing::ValuesIn(kernel_names()), KernelTest::name_of);

TEST_P(ReorderedRays, HitTheSame) {
  const auto snapshot = commit({{soup(60, 1), many_places(6, 2)}, {box_of_grids(3), many_places(3, 3)}});
  for (const int way : {0, 1, 2, 3}) {
    const bool mixed = way % 2 == 1;
    const std::vector<Ray> rays = hard_rays(way < 2 ? Vec3d{0.2, 0.4, 6.0} : Vec3d{50.0, 3000.0, 800.0}, mixed);
    EXPECT_EQ(Reordered(rays).rows.empty(), mixed);
    std::vector<Hit> hits(rays.size());
    std::vector<std::uint8_t> occluded(rays.size());
    SceneView view = snapshot->view;
    view.exceeds_cache = way >= 2;  // as if it were large
    const std::size_t packed =
        trace_closest(view, {rays.data(), rays.size(), Cull::kNone, nullptr, hits.data(), nullptr});
    std::size_t found = 0;
    trace_any(view, {rays.data(), rays.size(), Cull::kNone, nullptr, nullptr, occluded.data()});
    EXPECT_TRUE(mixed || (packed != 0) == (active_kernels().trace_packets_closest != nullptr));
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Hit expected = reference_closest(*snapshot, rays[i], Cull::kNone);
      ASSERT_EQ(std::memcmp(&hits[i], &expected, sizeof(Hit)), 0) << "ray " << i;
      ASSERT_EQ(occluded[i] != 0, expected.found()) << "ray " << i;
      found += expected.found() ? 1 : 0;
    }
    EXPECT_GT(found, rays.size() / 10);
  }
}

// Kernels trace the given rows, and touch no others.
TEST_P(ReorderedRays, AreThoseOfTheOrderOnly) {
  const auto snapshot = commit({{soup(100, 1), {Affine{}}}});
  const KernelTable& kernels = active_kernels();
  const std::vector<Ray> rays = camera_rays(40, 20);
  std::vector<Hit> expected(rays.size());
  trace_closest(*snapshot, rays, expected, Cull::kNone, {}, Strategy::kSingle);
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < 333; ++i) order.push_back((i * 7 + 3) % 800);  // all different
  for (const bool in_packets : {false, true}) {
    if (in_packets && kernels.trace_packets_closest == nullptr) continue;
    std::vector<Hit> hits(rays.size());
    for (Hit& hit : hits) hit.primitive_index = 12345;
    RayBatch batch{rays.data(), order.size(), Cull::kNone, nullptr, hits.data(), nullptr};
    batch.order = order.data();
    AlignedVector<std::byte> workspace(in_packets ? kernels.packet_workspace_bytes(snapshot->view)
                                                  : kernels.workspace_bytes(snapshot->view, 8));
    if (in_packets) {
      kernels.trace_packets_closest(snapshot->view, batch, workspace.data(), nullptr);
    } else {
      kernels.trace_closest(snapshot->view, batch, workspace.data(), 8);
    }
    for (std::uint32_t row = 0; row < rays.size(); ++row) {
      const bool is_told = std::find(order.begin(), order.end(), row) != order.end();
      if (is_told) {
        EXPECT_EQ(std::memcmp(&hits[row], &expected[row], sizeof(Hit)), 0) << "row " << row;
      } else {
        EXPECT_EQ(hits[row].primitive_index, 12345u) << "row " << row;
      }
    }
  }
}

}  // namespace
}  // namespace perfect_bvh::test
