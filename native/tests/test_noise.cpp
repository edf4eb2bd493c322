// The Noise Texture: it equals recorded values of Cycles, and its fractals have their properties.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "render/surface/noise.h"

namespace perfect_bvh {
namespace {

// Points and w at which tests/blender/texture_values.py recorded Cycles' values.
constexpr std::array<Vec3f, 3> kPoints{{{0.3f, -1.7f, 2.4f}, {-12.31f, 7.77f, 31.5f}, {1234.56f, -987.65f, 432.1f}}};
constexpr std::array kWs{0.9f, -3.2f, 55.5f};

struct Recorded {
  int dimensions;
  NoiseKind kind;
  std::array<Vec3f, 3> colors;  // at the points
};
const std::array<Recorded, 20> kRecorded{{
    {1,
     NoiseKind::kMultifractal,
     {{{1.259657f, 0.7709793f, 0.3912118f}, {0.7467479f, 1.529398f, 0.4409572f}, {1.926051f, 1.144275f, 1.396161f}}}},
    {1,
     NoiseKind::kRidgedMultifractal,
     {{{0.08296086f, 0.0005980966f, 0.07184903f},
       {0.04249724f, 0.04401311f, 0.02602346f},
       {0.1499034f, 0.02489453f, 0.004222882f}}}},
    {1,
     NoiseKind::kHybridMultifractal,
     {{{0.5376264f, -0.02432442f, -0.2632341f},
       {0.1913928f, 0.647065f, -0.1583153f},
       {1.312319f, 0.235226f, 0.9436339f}}}},
    {1,
     NoiseKind::kFbm,
     {{{0.5662219f, 0.4582455f, 0.3496018f},
       {0.4429552f, 0.6012249f, 0.3528718f},
       {0.6856003f, 0.5390662f, 0.5903012f}}}},
    {1,
     NoiseKind::kHeteroTerrain,
     {{{0.5450453f, -0.03856272f, -0.338089f},
       {0.2493698f, 0.7499623f, -0.1863537f},
       {1.567993f, 0.2831753f, 0.9565033f}}}},
    {2,
     NoiseKind::kMultifractal,
     {{{0.4914023f, 0.7984756f, 1.222593f}, {0.7302966f, 1.109844f, 1.260217f}, {0.5832434f, 0.8397147f, 1.29773f}}}},
    {2,
     NoiseKind::kRidgedMultifractal,
     {{{0.07189019f, 0.001552791f, 0.01358108f},
       {0.05279353f, 0.05267118f, 0.0009685563f},
       {0.05037524f, 0.0743741f, 0.005584538f}}}},
    {2,
     NoiseKind::kHybridMultifractal,
     {{{-0.2680939f, 0.0593421f, 0.8784616f},
       {0.3083476f, 0.5376917f, 0.9777798f},
       {0.2144619f, 0.2969475f, 0.9919711f}}}},
    {2,
     NoiseKind::kFbm,
     {{{0.4064386f, 0.4602898f, 0.5615544f},
       {0.4373918f, 0.5246941f, 0.567534f},
       {0.3891346f, 0.4627883f, 0.5746429f}}}},
    {2,
     NoiseKind::kHeteroTerrain,
     {{{-0.4205199f, 0.0588353f, 0.8853922f},
       {0.2578532f, 0.5422342f, 0.8393884f},
       {0.2128813f, 0.3398249f, 0.897898f}}}},
    {3,
     NoiseKind::kMultifractal,
     {{{0.9069451f, 1.474997f, 1.034071f}, {1.240564f, 0.8499382f, 0.8897022f}, {0.792594f, 1.107791f, 0.7092443f}}}},
    {3,
     NoiseKind::kRidgedMultifractal,
     {{{0.006057978f, 0.002519906f, 0.006178481f},
       {0.05850275f, 0.05224284f, 0.04053943f},
       {0.05304943f, 0.06858546f, 0.045291f}}}},
    {3,
     NoiseKind::kHybridMultifractal,
     {{{0.1267909f, 0.9139833f, 0.4618831f},
       {0.4700889f, 0.2959675f, 0.2733172f},
       {0.2605804f, 0.3263636f, 0.2327279f}}}},
    {3,
     NoiseKind::kFbm,
     {{{0.4915954f, 0.5969886f, 0.522534f}, {0.552244f, 0.464915f, 0.4755341f}, {0.4505415f, 0.5246186f, 0.4265437f}}}},
    {3,
     NoiseKind::kHeteroTerrain,
     {{{0.1250715f, 0.8950207f, 0.6502141f},
       {0.5940392f, 0.2906862f, 0.2753789f},
       {0.2810248f, 0.4165575f, 0.2398065f}}}},
    {4,
     NoiseKind::kMultifractal,
     {{{0.8119556f, 0.9353749f, 1.056873f}, {1.118965f, 0.7838383f, 1.254538f}, {0.980038f, 0.9928441f, 1.5573f}}}},
    {4,
     NoiseKind::kRidgedMultifractal,
     {{{0.07911907f, 0.02123603f, 0.03373055f},
       {0.05531922f, 0.00270986f, 0.0006247003f},
       {0.074674f, 0.01014471f, 0.02671028f}}}},
    {4,
     NoiseKind::kHybridMultifractal,
     {{{0.3503968f, 0.495284f, 0.517361f},
       {0.5492053f, -0.0520393f, 0.7186735f},
       {0.4778935f, 0.4937193f, 0.8817056f}}}},
    {4,
     NoiseKind::kFbm,
     {{{0.4564745f, 0.4899126f, 0.5142431f},
       {0.5271818f, 0.4678584f, 0.5631897f},
       {0.4989617f, 0.5077796f, 0.6134379f}}}},
    {4,
     NoiseKind::kHeteroTerrain,
     {{{0.3700952f, 0.5360281f, 0.5654166f},
       {0.5376292f, -0.08654226f, 0.8452215f},
       {0.4407101f, 0.6057437f, 0.8173314f}}}},
}};

void expect_near(Vec3f value, Vec3f expected, float tolerance) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(value[i], expected[i], tolerance);
}

TEST(Noise, EqualsCycles) {
  for (const Recorded& recorded : kRecorded) {
    SCOPED_TRACE(recorded.dimensions * 10 + static_cast<int>(recorded.kind));
    const NoiseSettings settings{.dimensions = recorded.dimensions,
                                 .kind = recorded.kind,
                                 .scale = 1.3f,
                                 .detail = 3.4f,
                                 .roughness = 0.6f,
                                 .lacunarity = 2.1f,
                                 .offset = 0.3f,
                                 .gain = 1.5f,
                                 .distortion = 0.7f};
    for (std::size_t i = 0; i < kPoints.size(); ++i) {
      expect_near(noise_color(settings, kPoints[i], kWs[i]), recorded.colors[i], 2e-6f);
      EXPECT_EQ(noise_factor(settings, kPoints[i], kWs[i]), noise_color(settings, kPoints[i], kWs[i]).x);
    }
  }
}

NoiseSettings plain(int dimensions) {
  return {.dimensions = dimensions, .normalize = false, .scale = 1.0f, .detail = 0.0f};
}

TEST(Noise, IsZeroAtIntegersAndBoundedBetween) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> anywhere(-100.0f, 100.0f);
  for (int dimensions = 1; dimensions <= 4; ++dimensions) {
    float largest = 0.0f;
    for (int i = 0; i < 20000; ++i) {
      const Vec3f p{anywhere(random), anywhere(random), anywhere(random)};
      const float w = anywhere(random);
      EXPECT_EQ(noise_factor(plain(dimensions), {std::floor(p.x), std::floor(p.y), std::floor(p.z)}, std::floor(w)), 0);
      largest = std::max(largest, std::abs(noise_factor(plain(dimensions), p, w)));
    }
    EXPECT_LE(largest, 1.0f);
    EXPECT_GT(largest, 0.6f);
  }
}

TEST(Noise, HasThePeriodOfItsLattice) {
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (const float x : {0.25f, 17.5f, 512.75f}) {
      const float here = noise_factor(plain(dimensions), {x, 0.5f, 0.25f}, x);
      EXPECT_NE(here, 0.0f);
      EXPECT_EQ(noise_factor(plain(dimensions), {x + 1e5f, 0.5f, 0.25f}, x + 1e5f), here);
    }
}

TEST(Noise, GoesFromOctaveToOctaveWithoutAStep) {
  for (const NoiseKind kind :
       {NoiseKind::kMultifractal, NoiseKind::kHybridMultifractal, NoiseKind::kFbm, NoiseKind::kHeteroTerrain}) {
    NoiseSettings settings{.kind = kind, .offset = 0.4f};
    const auto at = [&](float detail) {
      settings.detail = detail;
      return noise_factor(settings, kPoints[0], 0.0f);
    };
    EXPECT_NEAR(at(2.999f), at(3.0f), 1e-3f);
    EXPECT_NEAR(at(2.5f), 0.5f * (at(2.0f) + at(3.0f)), 1e-6f);
    EXPECT_EQ(at(99.0f), at(15.0f));
    EXPECT_EQ(at(-1.0f), at(0.0f));
  }
}

TEST(Noise, IsFiniteWhereverItIsAsked) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (const float x : {kInfinity, -kInfinity, kNan, 1e30f, -3e38f})
      EXPECT_TRUE(std::isfinite(noise_factor({.dimensions = dimensions, .distortion = 1.0f}, {x, x, 1.0f}, x)));
}

}  // namespace
}  // namespace perfect_bvh
