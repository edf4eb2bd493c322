// Images on boxes, and Gabor noise: properties that hold independently of Cycles' values.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "render/surface/gabor.h"
#include "render/surface/projections.h"

namespace perfect_bvh {
namespace {

// Dark on the left, bright on the right.
struct Halves {
  float pixels[8] = {0, 0, 0, 1, 1, 1, 1, 1};
  Texture texture;
  Halves() {
    texture.floats = pixels, texture.width = 2, texture.height = 1;
    texture.is_closest = true;
  }
};

TEST(Projections, SidesOfABoxAddUpToOne) {
  const float white[4] = {1, 1, 1, 1};
  Texture image;
  image.floats = white, image.width = image.height = 1;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> number(-1.0f, 1.0f);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3f normal{number(random), number(random), number(random)};
    const Rgba found = look_up_box(image, {0.3f, 0.4f, 0.5f}, normal, std::abs(number(random)));
    ASSERT_NEAR(found.r, 1.0f, 1e-4f) << normal.x << " " << normal.y << " " << normal.z;
    ASSERT_NEAR(found.a, 1.0f, 1e-4f);
  }
}

TEST(Projections, ASideOfABoxShowsItsOwnAxes) {
  const Halves halves;
  const auto shown = [&](Vec3f normal, Vec3f place) { return look_up_box(halves.texture, place, normal, 0.0f).r; };
  EXPECT_EQ(shown({1, 0, 0}, {0.9f, 0.1f, 0.9f}), 0.0f);
  EXPECT_EQ(shown({-1, 0, 0}, {0.9f, 0.1f, 0.9f}), 1.0f);
  EXPECT_EQ(shown({0, 1, 0}, {0.1f, 0.9f, 0.9f}), 1.0f);
  EXPECT_EQ(shown({0, -1, 0}, {0.1f, 0.9f, 0.9f}), 0.0f);
  EXPECT_EQ(shown({0, 0, 1}, {0.9f, 0.1f, 0.9f}), 1.0f);
  EXPECT_EQ(shown({0, 0, -1}, {0.9f, 0.1f, 0.9f}), 0.0f);
}

TEST(Gabor, IsAboutAHalfInTheMeanAndContinuous) {
  std::mt19937 random(6);
  std::uniform_real_distribution<float> number(-30.0f, 30.0f);
  for (const bool is_flat : {true, false}) {
    const GaborSettings settings{is_flat, 1.0f, 2.0f, 0.3f, 0.4f, {0.2f, -1.0f, 0.4f}};
    double sum = 0.0;
    constexpr int kCount = 4000;
    for (int i = 0; i < kCount; ++i) {
      const Vec3f p{number(random), number(random), number(random)};
      const Vec3f found = gabor_noise(settings, p), near = gabor_noise(settings, p + Vec3f{1e-4f, 1e-4f, 1e-4f});
      sum += static_cast<double>(found.x);
      ASSERT_NEAR(found.x, near.x, 0.01f);
      ASSERT_GE(found.z, 0.0f);
      ASSERT_TRUE(found.y >= 0.0f && found.y <= 1.0f);
    }
    EXPECT_NEAR(sum / kCount, 0.5, 0.01);
  }
}

TEST(Gabor, TakesAnyNumber) {
  const float odd[] = {0.0f, -7.5f, 1e30f, std::numeric_limits<float>::infinity(),
                       std::numeric_limits<float>::quiet_NaN()};
  for (const float value : odd) {
    for (const bool is_flat : {true, false}) {
      const Vec3f found = gabor_noise({is_flat, value, value, value, value, {value, value, value}}, {value, 1, 2});
      EXPECT_FALSE(found.x > 1e3f);
    }
  }
}

}  // namespace
}  // namespace perfect_bvh
