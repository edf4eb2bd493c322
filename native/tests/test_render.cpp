// The renderer's parts that need no scene: sample points, pixel filter, camera, colours.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "core/errors.h"
#include "render/filter/film.h"
#include "render/modes/shading.h"
#include "render/sampling/camera.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {
namespace {

// Returns whether 2^bits points have exactly one in each box of size 2^-across x 2^-(bits - across), for all shapes.
template <class PointAt>
bool is_net(std::uint32_t bits, const PointAt& point_at) {
  for (std::uint32_t across = 0; across <= bits; ++across) {
    std::set<std::uint32_t> boxes;
    for (std::uint32_t i = 0; i < (1u << bits); ++i) {
      const FixedPoint2 point = point_at(i);
      const std::uint32_t column = across == 0 ? 0 : point.x >> (32 - across);
      const std::uint32_t row = across == bits ? 0 : point.y >> (32 - (bits - across));
      boxes.insert((column << (bits - across)) | row);
    }
    if (boxes.size() != (std::size_t{1} << bits)) return false;
  }
  return true;
}

TEST(Sampler, EveryAlignedRunOfSamplesIsANet) {
  for (std::uint32_t seed : {0u, 1u, 77u}) {
    const Dimension dimension(seed, 3);
    for (std::uint32_t start : {0u, 64u, 4096u}) {
      EXPECT_TRUE(is_net(6, [&](std::uint32_t i) { return dimension.sample(start + i); })) << seed << ' ' << start;
    }
  }
}

TEST(Sampler, FlippingDigitsKeepsANet) {
  const Dimension dimension(5, 1);
  for (std::uint32_t place : {0u, 9u, 12345u}) {
    EXPECT_TRUE(is_net(5, [&](std::uint32_t i) { return dimension.sample(i) ^ dimension.offset(place); }));
  }
}

TEST(Sampler, FirstSamplesOfABlockOfPixelsAreANet) {
  const Dimension dimension(9, 2);
  for (std::uint32_t x : {0u, 8u, 640u}) {
    EXPECT_TRUE(is_net(6, [&](std::uint32_t i) {
      return dimension.sample(0) ^ dimension.offset(sampling::z_order(x + i % 8, 16 + i / 8));
    }));
  }
}

TEST(Sampler, NumbersStayBelowOne) {
  const Point2 largest = FixedPoint2{0xffffffffu, 0xffffffffu}.to_unit();
  EXPECT_LT(largest.x, 1.0f);
  EXPECT_LT(largest.y, 1.0f);
}

TEST(Film, FilterIsCentredAndAsWideAsAsked) {
  const PixelFilter filter(1.5f);
  double sum = 0.0, squares = 0.0;
  constexpr int kCount = 10000;
  for (int i = 0; i < kCount; ++i) {
    const Point2 offset = filter.offset({(static_cast<float>(i) + 0.5f) / kCount, 0.5f});
    EXPECT_LE(std::abs(offset.x), 1.5f);
    EXPECT_NEAR(offset.y, 0.0f, 1e-4f);
    sum += static_cast<double>(offset.x), squares += static_cast<double>(offset.x) * static_cast<double>(offset.x);
  }
  EXPECT_NEAR(sum / kCount, 0.0, 1e-4);
  // The window's second moment: with w = a0 - a1 cos + a2 cos 2 - a3 cos 3 over [-R, R] it is
  // R^2 (1/3 - 2/pi^2 (a1 - a2 / 4 + a3 / 9) / a0).
  const double expected = 2.25 * (1.0 / 3.0 - 0.2026423673 * (0.48829 - 0.14128 / 4 + 0.01168 / 9) / 0.35875);
  EXPECT_NEAR(squares / kCount, expected, 1e-3);
}

TEST(Film, SamplesCountInThePixelsThatTheFilterReaches) {
  for (const float width : {0.5f, 1.5f, 2.2f}) {
    const PixelFilter filter(width);
    EXPECT_EQ(filter.reach(), static_cast<int>(std::ceil(width - 0.5f)));
    PixelFilter::Weights weights;
    for (const float offset : {-0.5f, 0.0f, 0.3f}) {
      filter.weigh(offset, weights);
      for (int step = -filter.reach(); step <= filter.reach(); ++step) {
        const float weight = weights[static_cast<std::size_t>(step + filter.reach())];
        const double distance = std::abs(static_cast<double>(step) - static_cast<double>(offset));
        const double angle = 3.141592653589793 * (1.0 + distance / static_cast<double>(width));
        const double height =
            0.35875 - 0.48829 * std::cos(angle) + 0.14128 * std::cos(2 * angle) - 0.01168 * std::cos(3 * angle);
        EXPECT_NEAR(weight, distance > static_cast<double>(width) ? 0.0 : height, 1e-4);
      }
    }
  }
}

TEST(Film, EvenColoursStayEvenAcrossTiles) {
  const PixelFilter filter(1.5f);
  const TileGrid grid({28, 30, 70, 36});
  Film film(grid, filter, true);
  EXPECT_EQ(grid.count(), 6u);
  for (std::size_t tile = 0; tile < grid.count(); ++tile) {
    film.begin(tile);
    const PixelRect rect = grid.at(tile);
    for (int y = rect.y0; y < rect.y1; ++y) {
      for (int x = rect.x0; x < rect.x1; ++x) {
        const Pixel pixel{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
        const Point2 offset{0.4f - static_cast<float>(x % 3) * 0.4f, static_cast<float>(y % 2) * 0.5f - 0.3f};
        const Rgba color{0.25f, 1.0f, x == 64 && y == 32 ? 1.0f : 0.0f, 0.5f};
        const Vec3f albedo{0.5f, x < 40 ? 0.0f : 1.0f, 0.125f}, normal{0, 0, -1};
        film.add(tile, {&pixel, 1}, {&offset, 1}, {&color, 1}, {&albedo, 1}, {&normal, 1});
      }
    }
  }
  for (int y = 31; y < 35; ++y) {
    for (int x = 29; x < 69; ++x) {
      const FilmColor seen = film.pixel(x, y);
      const Rgba color = seen.color;
      EXPECT_NEAR(seen.albedo.x, 0.5f, 1e-6f);
      EXPECT_NEAR(seen.albedo.z, 0.125f, 1e-6f);
      EXPECT_NEAR(seen.normal.z, -1.0f, 1e-6f);
      EXPECT_EQ(seen.albedo.y > 0.0f && seen.albedo.y < 0.9999f, x == 39 || x == 40) << x;  // blended like colours
      EXPECT_NEAR(color.r, 0.25f, 1e-6f);
      EXPECT_NEAR(color.g, 1.0f, 1e-6f);
      EXPECT_NEAR(color.a, 0.5f, 1e-6f);
      const bool near = std::abs(x - 64) <= 1 && std::abs(y - 32) <= 1;
      EXPECT_EQ(color.b > 0.0f, near) << x << ' ' << y;
    }
  }
}

TEST(Film, NoWidthIsThePixelsCentre) {
  const Point2 offset = PixelFilter(0.0f).offset({0.1f, 0.9f});
  EXPECT_EQ(offset.x, 0.0f);
  EXPECT_EQ(offset.y, 0.0f);
}

TEST(Camera, DirectionsAdvanceByOneAlongTheViewAxis) {
  Camera camera;
  camera.camera_to_world = {{0, 2, 0}, {0, 0, 0.5}, {3, 0, 0}, {10, 20, 30}};  // looks along -x, up is z
  const RayMaker rays(camera, 64, 36);
  const Ray ray = rays.through(0.5, 0.5, 7);
  EXPECT_EQ(ray.origin, (Vec3d{10, 20, 30}));
  EXPECT_DOUBLE_EQ(ray.direction.x, -1.0);
  EXPECT_LT(ray.direction.y, 0.0);  // left
  EXPECT_GT(ray.direction.z, 0.0);  // top
  EXPECT_EQ(ray.mask, 7u);
  camera.projection = Projection::kOrthographic;
  EXPECT_EQ(RayMaker(camera, 64, 36).through(3, 5, 1).direction, (Vec3d{-1, 0, 0}));
}

TEST(Camera, PanoramasAreEvenInLongitudeAndLatitude) {
  Camera camera;
  camera.projection = Projection::kEquirectangular;
  camera.left = -1.5, camera.right = 1.5, camera.bottom = -1.0, camera.top = 1.0;
  const RayMaker rays(camera, 30, 20);
  const Ray ray = rays.through(21.0, 4.0, 1);  // 0.6 to the right, 0.6 upwards
  EXPECT_NEAR(ray.direction.x, std::sin(0.6) * std::cos(0.6), 1e-12);
  EXPECT_NEAR(ray.direction.y, std::sin(0.6), 1e-12);
  EXPECT_NEAR(ray.direction.z, -std::cos(0.6) * std::cos(0.6), 1e-12);
  const RayMaker::Steps steps = rays.steps_at(ray);
  constexpr double kPart = 1e-6;
  const Vec3d right = (rays.through(21.0 + kPart, 4.0, 1).direction - ray.direction) * (1.0 / kPart);
  const Vec3d down = (rays.through(21.0, 4.0 + kPart, 1).direction - ray.direction) * (1.0 / kPart);
  EXPECT_LT(length(steps.right - right), 1e-5);
  EXPECT_LT(length(steps.down - down), 1e-5);
}

TEST(Camera, APointIsSeenWhereARayGoesThroughIt) {
  Camera camera;
  camera.camera_to_world = {{0, 2, 0}, {0, 0, 0.5}, {3, 0, 0}, {10, 20, 30}};
  for (const Projection projection :
       {Projection::kPerspective, Projection::kOrthographic, Projection::kEquirectangular}) {
    camera.projection = projection;
    const RayMaker rays(camera, 64, 36);
    for (const double x : {0.25, 31.0, 63.5}) {
      const Ray ray = rays.through(x, 7.125, 3);
      const ImagePoint place = rays.place_of(ray.origin + ray.direction * 5.0);
      EXPECT_NEAR(place.x, x, 1e-9);
      EXPECT_NEAR(place.y, 7.125, 1e-9);
      EXPECT_NEAR(place.depth, 5.0, 1e-9);
    }
  }
}

TEST(Shutter, RowsOfARollingOneFollowEachOther) {
  const Camera camera;
  std::optional<Shutter> shutter = Shutter{};
  shutter->rolling = 0.25f;
  const ShutterRays rays(camera, shutter, 64, 100);
  EXPECT_FLOAT_EQ(rays.time_at(0.0f, 99), 0.75f);
  EXPECT_FLOAT_EQ(rays.time_at(0.5f, 49), 0.5f);
  EXPECT_NEAR(rays.time_at(0.0f, 0), 0.0075f, 1e-6f);
  EXPECT_LE(rays.time_at(0.999999f, 99), 1.0f);
  EXPECT_EQ(ShutterRays(camera, std::nullopt, 64, 100).time_at(0.5f, 3), kShutterOpens);
}

TEST(Camera, RaysThroughALensMeetInFocus) {
  Camera camera;
  camera.camera_to_world = {{0, 2, 0}, {0, 0, 0.5}, {3, 0, 0}, {10, 20, 30}};
  camera.lens = Lens{0.5, 4.0};
  for (const Projection projection :
       {Projection::kPerspective, Projection::kOrthographic, Projection::kEquirectangular}) {
    camera.projection = projection;
    const RayMaker rays(camera, 64, 36);
    const Ray middle = rays.through(50.0, 7.0, 3);
    for (const Point2 uniform : {Point2{0.1f, 0.2f}, Point2{0.9f, 0.4f}, Point2{0.3f, 0.99f}}) {
      Ray ray = middle;
      rays.bend(ray, camera.lens->point(uniform));
      EXPECT_GT(length(ray.origin - middle.origin), 0.1);
      EXPECT_NEAR(
          dot(ray.origin - middle.origin, projection == Projection::kEquirectangular ? middle.direction : rays.axis()),
          0.0, 1e-12);
      const Vec3d point = middle.origin + middle.direction * 4.0;
      const double t = projection == Projection::kEquirectangular ? length(point - ray.origin) : 4.0;
      EXPECT_LT(length(ray.origin + ray.direction * t - point), 1e-12);
      EXPECT_EQ(ray.mask, 3u);
    }
  }
}

TEST(Lens, PointsFillTheAperture) {
  for (const int blades : {0, 3, 4, 7}) {
    const Lens lens{2.0, 1.0, blades, 0.3, 1.5};
    const double half = blades < 3 ? 0.0 : std::numbers::pi / blades;
    double reach = 0.0, farthest = 0.0;
    for (std::uint32_t i = 0; i < 4096; ++i) {
      const Point2 point = lens.point(Dimension(1, 2).sample(i).to_unit());
      const double x = static_cast<double>(point.x) * 1.5 / 2.0, y = static_cast<double>(point.y) / 2.0;
      reach = std::max(reach, std::hypot(x, y));
      // The edges' distance from the middle: none of the points lies beyond any of them.
      for (int edge = 0; edge < blades; ++edge) {
        const double angle = 0.3 + 2.0 * half * edge;
        farthest = std::max(farthest, std::cos(angle) * x + std::sin(angle) * y);
      }
    }
    EXPECT_NEAR(reach, 1.0, 0.05) << blades;
    EXPECT_LT(reach, 1.0 + 1e-6) << blades;
    if (blades < 3) continue;
    EXPECT_NEAR(farthest, std::cos(half), 0.01) << blades;
    EXPECT_LT(farthest, std::cos(half) + 1e-6) << blades;
  }
}

TEST(Camera, AnAxisWithoutLengthIsRefused) {
  Camera camera;
  camera.camera_to_world.y = {0, 0, 0};
  EXPECT_THROW(RayMaker(camera, 8, 8), InvalidArgument);
}

TEST(Camera, BordersAreTruncatedToPixelsAndNeverEmpty) {
  Camera camera;
  camera.border_left = 0.26f, camera.border_right = 0.74f, camera.border_bottom = 0.5f, camera.border_top = 1.0f;
  const PixelRect rect = border_pixels(camera, 10, 10);
  EXPECT_EQ(rect.x0, 2);
  EXPECT_EQ(rect.x1, 7);
  EXPECT_EQ(rect.y0, 0);
  EXPECT_EQ(rect.y1, 5);
  camera.border_left = camera.border_right = camera.border_bottom = camera.border_top = 1.0f;
  const PixelRect corner = border_pixels(camera, 10, 10);
  EXPECT_EQ(corner.width(), 1);
  EXPECT_EQ(corner.height(), 1);
  EXPECT_TRUE((PixelRect{0, 0, 10, 10}.contains(corner.x0, corner.y0)));
}

float luminance(Vec3f color) { return dot(color, Vec3f{0.2126f, 0.7152f, 0.0722f}); }

TEST(Palette, RampGetsLighterAndStaysOnTheScreen) {
  const ColorRamp ramp;
  float last = -1.0f;
  for (int i = 0; i <= 100; ++i) {
    const Vec3f color = ramp.at(static_cast<float>(i) / 100.0f);
    EXPECT_GT(luminance(color), last);
    last = luminance(color);
    for (int axis = 0; axis < 3; ++axis) EXPECT_TRUE(color[axis] >= 0.0f && color[axis] <= 1.0f);
  }
  EXPECT_EQ(ramp.at(-1.0f), ramp.at(0.0f));
  EXPECT_EQ(ramp.at(7.0f), ramp.at(1.0f));
}

TEST(Palette, NearIdsLookUnlike) {
  for (std::uint32_t id = 0; id < 2000; ++id) {
    const Vec3f difference = id_color(id) - id_color(id + 1);
    EXPECT_GT(length(difference), 0.1f) << id;
  }
}

}  // namespace
}  // namespace perfect_bvh
