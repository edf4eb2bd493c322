// The world's image as a light: which part is sampled, with what density, and that no light is lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "render/light/emitters.h"

namespace perfect_bvh {
namespace {

constexpr double kPi = std::numbers::pi;

// A grey sky, darker below, with bright spots.
struct Image {
  int width, height;
  std::vector<float> pixels;
  Extension extension = Extension::kRepeat;
  Image(int wide, int high) : width(wide), height(high), pixels(static_cast<std::size_t>(wide * high * 4), 0.3f) {
    for (int y = 0; y < high / 2; ++y) {
      for (int x = 0; x < wide; ++x) set(x, y, {0.1f, 0.1f, 0.1f});
    }
  }
  void set(int x, int y, Vec3f color) {
    float* const pixel = &pixels[static_cast<std::size_t>((y * width + x) * 4)];
    pixel[0] = color.x, pixel[1] = color.y, pixel[2] = color.z, pixel[3] = 1.0f;
  }
  Texture texture() const {
    Texture made;
    made.floats = pixels.data(), made.width = width, made.height = height;
    made.extension = extension;
    return made;
  }
  // The sine of the latitude of a row's lower border.
  double sine_below(double y) const {
    const double up = 2.0 * y / height - 1.0;
    return std::sin(0.5 * kPi * (extension == Extension::kSky ? up * std::abs(up) : up));
  }
};

std::vector<Image> suns() {
  std::vector<Image> made;
  Image& small = made.emplace_back(64, 32);  // at the seam, where the image's left and right edges meet
  small.set(0, 20, {900, 800, 700});
  Image& windows = made.emplace_back(128, 64);
  for (int i = 0; i < 4; ++i) windows.set(30 + i, 30, {500, 400, 300}), windows.set(90, 40 + i, {100, 200, 90});
  Image& poles = made.emplace_back(64, 32);
  poles.set(10, 31, {3000, 3000, 3000}), poles.set(40, 0, {2000, 2000, 2000});
  Image& air = made.emplace_back(64, 64);
  air.set(20, 52, {500, 400, 300}), air.set(50, 11, {100, 200, 90}), air.extension = Extension::kSky;
  Image& large = made.emplace_back(4100, 8);  // several pixels a cell, the last of a row narrower
  large.set(4099, 5, {9000, 9000, 9000}), large.set(1234, 4, {5000, 8000, 9000});
  return made;
}

Point2 random(std::uint32_t index, std::uint32_t seed = 3) { return sampling::scrambled_sobol(index, seed).to_unit(); }

TEST(BrightSky, DirectionsHaveTheDensityThatIsTold) {
  for (const Image& image : suns()) {
    const BrightSky sky(image.texture(), 1);
    ASSERT_FALSE(sky.empty());
    int other = 0;
    for (std::uint32_t i = 0; i < 4096; ++i) {
      const auto [direction, density] = sky.choose(random(i));
      EXPECT_NEAR(length(direction), 1.0f, 1e-5f);
      ASSERT_GT(density, 0.0f);
      // On the border between two cells rounding may choose either.
      if (std::abs(sky.density(direction) / density - 1.0f) > 1e-4f) ++other;
    }
    EXPECT_LT(other, 40) << image.width;
  }
}

TEST(BrightSky, DensityIntegratesToOneAndIsNowhereMissing) {
  for (const Image& image : suns()) {
    if (image.width > 128) continue;
    const BrightSky sky(image.texture(), 1);
    double sum = 0.0;
    constexpr int kTimes = 8;  // sample points per pixel and axis
    const int wide = image.width * kTimes, high = image.height * kTimes;
    for (int row = 0; row < high; ++row) {
      const double low = image.sine_below(1.0 * row / kTimes), above = image.sine_below((row + 1.0) / kTimes);
      const double z = 0.5 * (low + above), flat = std::sqrt(1.0 - z * z);
      for (int column = 0; column < wide; ++column) {
        const double angle = (0.5 - (column + 0.5) / wide) * 2.0 * kPi;
        const Vec3f direction = to_float(Vec3d{flat * std::cos(angle), flat * std::sin(angle), z});
        const float density = sky.density(direction);
        sum += static_cast<double>(density) * (above - low) * (2.0 * kPi / wide);
        const Vec3f bright = sky.split(look_up_around(image.texture(), direction)).bright;
        if (bright.x + bright.y + bright.z > 0.0f) {
          EXPECT_GT(density, 0.0f) << column << " " << row;
        }
      }
    }
    EXPECT_NEAR(sum, 1.0, 0.01) << image.width;
  }
}

// The sampled bright part plus the mean of the rest gives the image's mean.
TEST(BrightSky, NoLightIsLost) {
  for (const Image& image : suns()) {
    const BrightSky sky(image.texture(), 1);
    Vec3d aimed{0, 0, 0}, whole{0, 0, 0};
    constexpr std::uint32_t kCount = 1u << 16;
    for (std::uint32_t i = 0; i < kCount; ++i) {
      const auto [direction, density] = sky.choose(random(i));
      const Vec3f bright = sky.split(look_up_around(image.texture(), direction)).bright;
      aimed = aimed + to_double(bright) * (1.0 / (4.0 * kPi * static_cast<double>(density) * kCount));
    }
    for (int y = 0; y < image.height; ++y) {
      std::vector<Rgba> buffer;
      for (const Rgba& color : row_of_pixels(image.texture(), y, buffer)) {
        whole = whole + to_double(Vec3f{color.r, color.g, color.b}) *
                            (0.5 * (image.sine_below(y + 1) - image.sine_below(y)) / image.width);
      }
    }
    const Vec3d sum = aimed + to_double(sky.mean_plain());
    // With bilinear interpolation, a bright pixel at a pole covers a little more or less than its own solid angle.
    const double tolerance = image.height < 32 ? 0.15 : 0.06;
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(sum[axis] / whole[axis], 1.0, tolerance) << image.width;
  }
}

TEST(BrightSky, IsTheSameForAnyNumberOfThreads) {
  const std::vector<Image> images = suns();
  const BrightSky one(images.front().texture(), 1), many(images.front().texture(), 0);
  for (std::uint32_t i = 0; i < 64; ++i) {
    EXPECT_EQ(one.choose(random(i)).direction, many.choose(random(i)).direction);
    EXPECT_EQ(one.choose(random(i)).density, many.choose(random(i)).density);
  }
  EXPECT_EQ(one.mean_plain(), many.mean_plain());
}

TEST(BrightSky, AnEvenOneIsNotAimedAt) {
  EXPECT_TRUE(BrightSky(Image(64, 32).texture(), 1).empty());
  EXPECT_TRUE(BrightSky(Texture{}, 1).empty());
  Image black(8, 4);
  std::fill(black.pixels.begin(), black.pixels.end(), 0.0f);
  EXPECT_TRUE(BrightSky(black.texture(), 1).empty());
  Image broken(64, 32);
  broken.set(3, 3, {std::numeric_limits<float>::quiet_NaN(), 1, 1});
  broken.set(5, 3, {std::numeric_limits<float>::infinity(), 1, 1});
  const BrightSky sky(broken.texture(), 1);
  EXPECT_TRUE(sky.empty());
  EXPECT_TRUE(std::isfinite(sky.mean_plain().x));
}

TEST(BrightSky, ColoursAreSplitWithoutRest) {
  const std::vector<Image> images = suns();
  const BrightSky sky(images.front().texture(), 1);
  for (const Vec3f color : {Vec3f{0.3f, 0.2f, 0.1f}, Vec3f{900, 300, 10}, Vec3f{0, 0, 0}}) {
    const auto [plain, bright] = sky.split(color);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(plain[axis] + bright[axis], color[axis], 1e-4f * color[axis]);
      EXPECT_GE(bright[axis], 0.0f);
    }
  }
  EXPECT_EQ(sky.split({0.3f, 0.2f, 0.1f}).bright, (Vec3f{0, 0, 0}));
}

}  // namespace
}  // namespace perfect_bvh
