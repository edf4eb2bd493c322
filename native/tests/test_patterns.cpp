// Checker, Brick, Gradient, Magic, Wave and White Noise textures: they equal recorded values of Cycles, and have the
// right periods and ranges.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "render/surface/patterns.h"

namespace perfect_bvh {
namespace {

// Points and w at which tests/blender/texture_values.py recorded Cycles' values.
constexpr std::array<Vec3f, 3> kPoints{{{0.3f, -1.7f, 2.4f}, {-12.31f, 7.77f, 31.5f}, {1234.56f, -987.65f, 432.1f}}};
constexpr std::array kWs{0.9f, -3.2f, 55.5f};

void expect_near(Vec3f value, Vec3f expected, float tolerance) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(value[i], expected[i], tolerance);
}

TEST(Patterns, WhiteNoiseEqualsCycles) {
  constexpr std::array<std::array<Vec3f, 3>, 4> kRecorded{{
      {{{0.9272993f, 0.8227484f, 0.2743712f},
        {0.4472259f, 0.4068149f, 0.8725958f},
        {0.2350041f, 0.2291057f, 0.9707045f}}},
      {{{0.7311046f, 0.01934499f, 0.1476828f},
        {0.2677242f, 0.8696239f, 0.9772956f},
        {0.5892532f, 0.2096241f, 0.3577079f}}},
      {{{0.1024142f, 0.02489794f, 0.6596743f},
        {0.2086844f, 0.865909f, 0.318251f},
        {0.1017185f, 0.1986831f, 0.6423078f}}},
      {{{0.03922025f, 0.09395538f, 0.8904749f},
        {0.08256894f, 0.712645f, 0.2040068f},
        {0.3541782f, 0.7893372f, 0.7911022f}}},
  }};
  for (int dimensions = 1; dimensions <= 4; ++dimensions)
    for (std::size_t i = 0; i < kPoints.size(); ++i) {
      const Vec3f color = white_noise_color(dimensions, kPoints[i], kWs[i]);
      expect_near(color, kRecorded[static_cast<std::size_t>(dimensions - 1)][i], 1e-7f);
      EXPECT_EQ(white_noise_value(dimensions, kPoints[i], kWs[i]), color.x);
    }
}

TEST(Patterns, CheckersAlternate) {
  EXPECT_EQ(checker_factor(1.3f, kPoints[0]), 0.0f);
  EXPECT_EQ(checker_factor(1.3f, kPoints[1]), 1.0f);
  EXPECT_EQ(checker_factor(1.3f, kPoints[2]), 1.0f);
  for (int x = -3; x <= 3; ++x)
    for (int y = -3; y <= 3; ++y)
      for (int z = -3; z <= 3; ++z) {
        const Vec3f p{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        for (const float inside : {0.1f, 0.9f}) {
          const float factor = checker_factor(1.0f, p + Vec3f{inside, inside, inside});
          EXPECT_EQ(factor, (x + y + z) % 2 == 0 ? 0.0f : 1.0f);
        }
      }
}

TEST(Patterns, GradientsEqualCycles) {
  constexpr std::array kRecorded{0.3f, 0.09f, 0.216f, 0.225f, 0.6094865f, 0.3714738f, 0.5737918f};
  for (std::size_t i = 0; i < kRecorded.size(); ++i)
    EXPECT_NEAR(gradient_factor(static_cast<GradientKind>(i), {0.3f, 0.15f, -0.2f}), kRecorded[i], 1e-6f);
}

TEST(Patterns, GradientsEndAtZeroAndOne) {
  for (std::size_t i = 0; i < 7; ++i)
    for (const float x : {-7.0f, 0.0f, 7.0f}) {
      const float factor = gradient_factor(static_cast<GradientKind>(i), {x, 0.0f, 0.0f});
      EXPECT_TRUE(factor >= 0.0f && factor <= 1.0f);
    }
  EXPECT_EQ(gradient_factor(GradientKind::kLinear, {7.0f, 0.0f, 0.0f}), 1.0f);
  EXPECT_EQ(gradient_factor(GradientKind::kSpherical, {7.0f, 0.0f, 0.0f}), 0.0f);
  EXPECT_EQ(gradient_factor(GradientKind::kRadial, {-7.0f, 0.0f, 0.0f}), 1.0f);
}

TEST(Patterns, MagicOfEveryDepthEqualsCycles) {
  constexpr std::array<Vec3f, 11> kRecorded{{
      {0.4282933f, 0.8158128f, 0.8026063f},
      {0.39244f, 0.9639402f, 0.9539096f},
      {0.9989323f, 0.9639402f, 0.9539096f},
      {0.9989323f, 0.9639402f, 0.9475719f},
      {0.5613968f, 0.9639402f, 0.9475719f},
      {0.5613968f, 0.2213015f, 0.9475719f},
      {0.5613968f, 0.9742342f, 0.9475719f},
      {0.9908139f, 0.9742342f, 0.9475719f},
      {0.9908139f, 0.9742342f, 0.9999157f},
      {0.5872507f, 0.9742342f, 0.9999157f},
      {0.5872507f, 0.3338238f, 0.9999157f},
  }};
  for (int depth = 0; depth <= 10; ++depth)
    expect_near(magic_color({depth, 1.3f, 1.5f}, kPoints[0]), kRecorded[static_cast<std::size_t>(depth)], 2e-5f);
}

TEST(Patterns, MagicWithoutDistortionIsGray) {
  expect_near(magic_color({3, 2.0f, 0.0f}, kPoints[0]), {0.5f, 0.5f, 0.5f}, 0.0f);
}

TEST(Patterns, WavesEqualCycles) {
  // Sine, saw and triangle: of bands, then of rings, in each direction.
  constexpr std::array<Vec3f, 8> kRecorded{{
      {0.9568647f, 0.5665947f, 0.8668107f},
      {0.5098029f, 0.7468796f, 0.5062408f},
      {0.9421835f, 0.5772953f, 0.8454094f},
      {0.02588117f, 0.948568f, 0.102864f},
      {0.8838626f, 0.6106944f, 0.7786112f},
      {0.8792492f, 0.6129665f, 0.7740669f},
      {0.6260374f, 0.2905564f, 0.5811129f},
      {0.8190975f, 0.6398406f, 0.7203188f},
  }};
  for (std::size_t i = 0; i < kRecorded.size(); ++i)
    for (int profile = 0; profile < 3; ++profile) {
      const WaveSettings settings{.kind = static_cast<WaveKind>(i / 4),
                                  .direction = static_cast<WaveDirection>(i % 4),
                                  .profile = static_cast<WaveProfile>(profile),
                                  .scale = 0.6f,
                                  .distortion = 3.0f,
                                  .detail = 2.6f,
                                  .detail_scale = 1.7f,
                                  .detail_roughness = 0.7f,
                                  .phase = 0.3f};
      EXPECT_NEAR(wave_factor(settings, kPoints[0]), kRecorded[i][profile], 1e-5f);
    }
}

TEST(Patterns, WavesHaveAPeriod) {
  constexpr float kTurn = 2.0f * std::numbers::pi_v<float>;
  for (const WaveProfile profile : {WaveProfile::kSine, WaveProfile::kSaw, WaveProfile::kTriangle}) {
    WaveSettings settings{.profile = profile, .scale = 1.0f};
    const float here = wave_factor(settings, {0.11f, 0.0f, 0.0f});
    EXPECT_NEAR(wave_factor(settings, {0.11f + kTurn / 20.0f, 4.0f, 5.0f}), here, 1e-5f);
    settings.phase = kTurn;
    EXPECT_NEAR(wave_factor(settings, {0.11f, 0.0f, 0.0f}), here, 1e-5f);
  }
}

TEST(Patterns, BricksEqualCycles) {
  struct Recorded {
    Vec3f point;
    float mortar;
    Vec3f color;
  };
  constexpr std::array<Recorded, 5> kRecorded{{{{0.3f, -1.7f, 2.4f}, 1.0f, {0.05f, 0.5f, 1.0f}},
                                               {{-7.11f, 0.63f, 1.0f}, 0.0f, {0.724634f, 0.2004881f, 0.312561f}},
                                               {{5.4f, -0.42f, 0.0f}, 0.4500763f, {0.2406842f, 0.5757086f, 0.652013f}},
                                               {{0.01f, 0.02f, 0.0f}, 0.0485927f, {0.556196f, 0.3959165f, 0.3685749f}},
                                               {{9.2f, 4.3f, 0.0f}, 0.7407711f, {0.1210855f, 0.5607567f, 0.8390958f}}}};
  for (const Recorded& recorded : kRecorded) {
    const BrickTexture brick = brick_texture({.offset = 0.3f,
                                              .offset_frequency = 3,
                                              .squash = 1.7f,
                                              .squash_frequency = 4,
                                              .scale = 2.3f,
                                              .mortar_size = 0.05f,
                                              .mortar_smooth = 0.6f,
                                              .bias = 0.1f,
                                              .brick_width = 0.7f,
                                              .row_height = 0.31f},
                                             recorded.point);
    EXPECT_NEAR(brick.mortar, recorded.mortar, 3e-5f);
    const auto mixed = [](Vec3f a, Vec3f b, float share) { return a * (1.0f - share) + b * share; };
    const Vec3f of_brick = mixed({0.8f, 0.1f, 0.3f}, {0.2f, 0.9f, 0.4f}, brick.tint);
    expect_near(mixed(of_brick, {0.05f, 0.5f, 1.0f}, brick.mortar), recorded.color, 3e-5f);
  }
}

TEST(Patterns, BricksOfARowAreInTheirPlaces) {
  const BrickSettings settings{.scale = 1.0f, .mortar_size = 0.05f, .mortar_smooth = 0.0f};
  for (int brick = -4; brick < 4; ++brick) {
    const float begin = static_cast<float>(brick) * 0.5f;
    EXPECT_EQ(brick_texture(settings, {begin + 0.01f, 0.375f, 0.0f}).mortar, 1.0f);  // odd rows
    EXPECT_EQ(brick_texture(settings, {begin + 0.25f, 0.375f, 0.0f}).mortar, 0.0f);
    EXPECT_EQ(brick_texture(settings, {begin + 0.26f, 0.125f, 0.0f}).mortar, 1.0f);  // shifted by half a brick
    EXPECT_EQ(brick_texture(settings, {begin, 0.125f, 0.0f}).mortar, 0.0f);
    EXPECT_EQ(brick_texture(settings, {begin + 0.25f, 0.26f, 0.0f}).mortar, 1.0f);
  }
}

}  // namespace
}  // namespace perfect_bvh
