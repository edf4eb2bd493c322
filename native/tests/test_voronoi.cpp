// The Voronoi Texture: it equals recorded values of Cycles, and its features have their properties.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "render/surface/voronoi.h"

namespace perfect_bvh {
namespace {

struct Recorded {
  int dimensions;
  VoronoiFeature feature;
  VoronoiMetric metric;
  VoronoiTexture values;  // of Cycles, from tests/blender/texture_values.py
};
const std::vector<Recorded> kRecorded{
    {1,
     VoronoiFeature::kF1,
     VoronoiMetric::kEuclidean,
     {0.1738441f, {0.4346778f, 0.5815356f, 0.7020447f}, {0, 0, 0}, 0.9626015f, 0}},
    {1, VoronoiFeature::kDistanceToEdge, VoronoiMetric::kEuclidean, {0.4256954f, {0, 0, 0}, {0, 0, 0}, 0, 0}},
    {1, VoronoiFeature::kNSphereRadius, VoronoiMetric::kEuclidean, {0, {0, 0, 0}, {0, 0, 0}, 0, 0.3046706f}},
    {2,
     VoronoiFeature::kF1,
     VoronoiMetric::kEuclidean,
     {0.2280317f, {0.7914129f, 0.7828591f, 0.5221959f}, {0.3090907f, -1.758958f, 0.0f}, 0, 0}},
    {2,
     VoronoiFeature::kF1,
     VoronoiMetric::kManhattan,
     {0.2078469f, {0.7914129f, 0.7828591f, 0.5221959f}, {0.3090907f, -1.758958f, 0.0f}, 0, 0}},
    {2,
     VoronoiFeature::kF1,
     VoronoiMetric::kChebychev,
     {0.2915283f, {0.7507219f, 0.791539f, 0.4872237f}, {0.3353145f, -1.750685f, 0.0f}, 0, 0}},
    {2,
     VoronoiFeature::kF1,
     VoronoiMetric::kMinkowski,
     {0.2171438f, {0.7914129f, 0.7828591f, 0.5221959f}, {0.3090907f, -1.758958f, 0.0f}, 0, 0}},
    {2,
     VoronoiFeature::kF2,
     VoronoiMetric::kMinkowski,
     {0.2689007f, {0.4725606f, 0.4523019f, 0.6651241f}, {0.256137f, -1.53285f, 0.0f}, 0, 0}},
    {2,
     VoronoiFeature::kSmoothF1,
     VoronoiMetric::kManhattan,
     {0.2077202f, {0.7917733f, 0.7796412f, 0.5223703f}, {0.3066367f, -1.759671f, 0.0f}, 0, 0}},
    {2, VoronoiFeature::kDistanceToEdge, VoronoiMetric::kEuclidean, {0.2643282f, {0, 0, 0}, {0, 0, 0}, 0, 0}},
    {2, VoronoiFeature::kNSphereRadius, VoronoiMetric::kEuclidean, {0, {0, 0, 0}, {0, 0, 0}, 0, 0.4951458f}},
    {3,
     VoronoiFeature::kF1,
     VoronoiMetric::kEuclidean,
     {0.3068314f, {0.4147232f, 0.4086663f, 0.5285968f}, {0.1953311f, -1.562455f, 2.505908f}, 0, 0}},
    {3,
     VoronoiFeature::kF1,
     VoronoiMetric::kManhattan,
     {0.2674122f, {0.4147232f, 0.4086663f, 0.5285968f}, {0.1953311f, -1.562455f, 2.505908f}, 0, 0}},
    {3,
     VoronoiFeature::kF1,
     VoronoiMetric::kChebychev,
     {0.4014117f, {0.4147232f, 0.4086663f, 0.5285968f}, {0.1953311f, -1.562455f, 2.505908f}, 0, 0}},
    {3,
     VoronoiFeature::kF1,
     VoronoiMetric::kMinkowski,
     {0.2864781f, {0.4147232f, 0.4086663f, 0.5285968f}, {0.1953311f, -1.562455f, 2.505908f}, 0, 0}},
    {3,
     VoronoiFeature::kF2,
     VoronoiMetric::kMinkowski,
     {0.2347779f, {0.4102949f, 0.7650686f, 0.2543603f}, {0.4250369f, -1.648643f, 2.651299f}, 0, 0}},
    {3,
     VoronoiFeature::kSmoothF1,
     VoronoiMetric::kManhattan,
     {0.2626155f, {0.4175076f, 0.3702619f, 0.5058031f}, {0.2441058f, -1.568346f, 2.492558f}, 0, 0}},
    {3, VoronoiFeature::kDistanceToEdge, VoronoiMetric::kEuclidean, {0.21517f, {0, 0, 0}, {0, 0, 0}, 0, 0}},
    {3, VoronoiFeature::kNSphereRadius, VoronoiMetric::kEuclidean, {0, {0, 0, 0}, {0, 0, 0}, 0, 0.3639738f}},
    {4,
     VoronoiFeature::kF1,
     VoronoiMetric::kEuclidean,
     {0.3701306f, {0.4672697f, 0.3100939f, 0.5093521f}, {0.2198704f, -1.872913f, 2.464773f}, 1.003175f, 0}},
    {4,
     VoronoiFeature::kF1,
     VoronoiMetric::kManhattan,
     {0.2913966f, {0.6552802f, 0.4098022f, 0.5304415f}, {0.3124003f, -2.011973f, 2.475152f}, 0.938108f, 0}},
    {4,
     VoronoiFeature::kF1,
     VoronoiMetric::kChebychev,
     {0.5747291f, {0.2644287f, 0.3823003f, 0.638088f}, {0.1360142f, -1.843062f, 2.254609f}, 0.9555945f, 0}},
    {4,
     VoronoiFeature::kF1,
     VoronoiMetric::kMinkowski,
     {0.3296056f, {0.4672697f, 0.3100939f, 0.5093521f}, {0.2198704f, -1.872913f, 2.464773f}, 1.003175f, 0}},
    {4,
     VoronoiFeature::kF2,
     VoronoiMetric::kMinkowski,
     {0.181419f, {0.4213269f, 0.4524811f, 0.6157019f}, {0.2451438f, -1.965088f, 2.278203f}, 0.8830102f, 0}},
    {4,
     VoronoiFeature::kSmoothF1,
     VoronoiMetric::kManhattan,
     {0.2767691f, {0.5043764f, 0.4048541f, 0.4459477f}, {0.2209976f, -1.948888f, 2.398609f}, 0.8865467f, 0}},
    {4, VoronoiFeature::kDistanceToEdge, VoronoiMetric::kEuclidean, {0.009608948f, {0, 0, 0}, {0, 0, 0}, 0, 0}},
    {4, VoronoiFeature::kNSphereRadius, VoronoiMetric::kEuclidean, {0, {0, 0, 0}, {0, 0, 0}, 0, 0.3545013f}},
};

void expect_near(Vec3f value, Vec3f expected, float tolerance) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(value[i], expected[i], tolerance);
}

TEST(Voronoi, EqualsCycles) {
  for (const Recorded& recorded : kRecorded) {
    SCOPED_TRACE(recorded.dimensions * 100 + static_cast<int>(recorded.feature) * 10 +
                 static_cast<int>(recorded.metric));
    const VoronoiSettings settings{.dimensions = recorded.dimensions,
                                   .feature = recorded.feature,
                                   .metric = recorded.metric,
                                   .normalize = true,
                                   .scale = 1.3f,
                                   .detail = 1.4f,
                                   .roughness = 0.6f,
                                   .lacunarity = 2.1f,
                                   .smoothness = 0.7f,
                                   .exponent = 1.4f,
                                   .randomness = 0.9f};
    const VoronoiTexture texture = voronoi_texture(settings, {0.3f, -1.7f, 2.4f}, 0.9f);
    EXPECT_NEAR(texture.distance, recorded.values.distance, 2e-6f);
    expect_near(texture.color, recorded.values.color, 2e-6f);
    expect_near(texture.position, recorded.values.position, 2e-6f);
    EXPECT_NEAR(texture.w, recorded.values.w, 2e-6f);
    EXPECT_NEAR(texture.radius, recorded.values.radius, 2e-6f);
  }
}

struct Point {
  Vec3f p;
  float w;
};
std::vector<Point> anywhere() {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> number(-50.0f, 50.0f);
  std::vector<Point> points;
  for (int i = 0; i < 2000; ++i) points.push_back({{number(random), number(random), number(random)}, number(random)});
  return points;
}

TEST(Voronoi, TheFirstPointIsNearerThanTheSecond) {
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (const Point& point : anywhere()) {
      VoronoiSettings settings{.dimensions = dimensions, .scale = 1.0f};
      const VoronoiTexture first = voronoi_texture(settings, point.p, point.w);
      settings.feature = VoronoiFeature::kF2;
      const VoronoiTexture second = voronoi_texture(settings, point.p, point.w);
      EXPECT_LT(first.distance, second.distance);
      const Vec3f way = first.position - point.p;
      if (dimensions == 1) {
        EXPECT_NEAR(std::abs(first.w - point.w), first.distance, 1e-5f);
      } else if (dimensions == 3) {
        EXPECT_NEAR(length(way), first.distance, 1e-5f);
      }
    }
}

TEST(Voronoi, PointsThatAreNotRandomAreTheCornersOfAGrid) {
  for (const Point& point : anywhere()) {
    VoronoiSettings settings{.scale = 1.0f, .randomness = 0.0f};
    Vec3f way{0, 0, 0};
    for (int i = 0; i < 3; ++i) way[i] = std::abs(point.p[i] - std::round(point.p[i]));
    EXPECT_NEAR(voronoi_texture(settings, point.p, 0.0f).distance, length(way), 1e-5f);
    settings.metric = VoronoiMetric::kManhattan;
    EXPECT_NEAR(voronoi_texture(settings, point.p, 0.0f).distance, way.x + way.y + way.z, 1e-5f);
    settings.metric = VoronoiMetric::kChebychev;
    EXPECT_NEAR(voronoi_texture(settings, point.p, 0.0f).distance, std::max({way.x, way.y, way.z}), 1e-5f);
    settings.metric = VoronoiMetric::kMinkowski, settings.exponent = 1.0f;
    EXPECT_NEAR(voronoi_texture(settings, point.p, 0.0f).distance, way.x + way.y + way.z, 1e-5f);
    settings.feature = VoronoiFeature::kDistanceToEdge;
    EXPECT_NEAR(voronoi_texture(settings, point.p, 0.0f).distance, 0.5f - std::max({way.x, way.y, way.z}), 1e-5f);
    settings.feature = VoronoiFeature::kNSphereRadius;
    EXPECT_EQ(voronoi_texture(settings, point.p, 0.0f).radius, 0.5f);
  }
}

TEST(Voronoi, WithoutSmoothnessTheNearestPointIsLeft) {
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (std::size_t i = 0; i < 50; ++i) {
      const Point point = anywhere()[i];
      VoronoiSettings settings{.dimensions = dimensions, .smoothness = 1e-6f};
      const VoronoiTexture nearest = voronoi_texture(settings, point.p, point.w);
      settings.feature = VoronoiFeature::kSmoothF1;
      EXPECT_NEAR(voronoi_texture(settings, point.p, point.w).distance, nearest.distance, 1e-5f);
      settings.smoothness = 0.0f;
      EXPECT_EQ(voronoi_texture(settings, point.p, point.w).distance, nearest.distance);
    }
}

TEST(Voronoi, CellsFarAwayAndNowhereAreCells) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (const float x : {1e9f, -1e9f, 1e30f, kInfinity, kNan}) {
      const VoronoiTexture texture = voronoi_texture({.dimensions = dimensions}, {x, x, x}, x);
      for (int i = 0; i < 3; ++i) EXPECT_TRUE(texture.color[i] >= 0.0f && texture.color[i] <= 1.0f);
    }
}

}  // namespace
}  // namespace perfect_bvh
