// Light in hair: no light is lost, and directions are chosen with the reported density.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "render/sampling/sampler.h"
#include "render/surface/bsdf.h"
#include "render/surface/hair_bsdf.h"

namespace perfect_bvh {
namespace {

constexpr double kPi = std::numbers::pi;

HairDirection direction_at(double slant, double around) { return {std::sin(slant), std::cos(slant), around}; }

// Integrates over the sphere, at the cell centres of a grid that is even in the sine of the slant and in the angle
// around.
double integral(const std::function<double(const HairDirection&)>& value) {
  constexpr int kSteps = 720;
  double sum = 0.0;
  for (int row = 0; row < kSteps; ++row) {
    const double sine = 2.0 * (row + 0.5) / kSteps - 1.0, cosine = std::sqrt(1.0 - sine * sine);
    for (int column = 0; column < kSteps; ++column) {
      sum += value({sine, cosine, 2.0 * kPi * (column + 0.5) / kSteps - kPi});
    }
  }
  return sum * 4.0 * kPi / (kSteps * kSteps);
}

// Functions whose means describe the position and width of a distribution.
const std::array<double (*)(const HairDirection&), 5> kProbes{
    [](const HairDirection&) { return 1.0; }, [](const HairDirection& at) { return at.sine; },
    [](const HairDirection& at) { return at.sine * at.sine; },
    [](const HairDirection& at) { return at.cosine * std::cos(at.around); },
    [](const HairDirection& at) { return at.cosine * std::sin(at.around); }};

void expect_agreement(const std::function<double(const HairDirection&)>& density,
                      const std::function<HairDirection(std::uint32_t)>& sample, double margin,
                      const std::string& name) {
  constexpr std::uint32_t kSamples = 1 << 14;
  for (std::size_t probe = 0; probe < kProbes.size(); ++probe) {
    const double expected = integral([&](const HairDirection& at) { return density(at) * kProbes[probe](at); });
    double sum = 0.0;
    for (std::uint32_t i = 0; i < kSamples; ++i) sum += kProbes[probe](sample(i));
    EXPECT_NEAR(sum / kSamples, expected, margin) << name << ", probe " << probe;
  }
}

Point2 random(std::uint32_t index, std::uint32_t seed) { return sampling::scrambled_sobol(index, seed).to_unit(); }

Hair hair_of(float roughness, float tilt = 0.0f) {
  Hair hair;
  hair.fiber = 1.0f, hair.tilt = tilt;
  hair.roughness = hair.radial_roughness = roughness;
  return hair;
}

TEST(HairFiber, KeepsAllLightThatIsNotAbsorbed) {
  for (const double slant : {-1.2, 0.0, 0.7}) {
    for (const double aside : {-0.95, 0.0, 0.5}) {
      const HairFiber fiber(hair_of(0.3f), {0, 0.1f, 10}, direction_at(slant, 0.0), aside, 0.0f);
      EXPECT_NEAR(fiber.albedo().x, 1.0f, 2e-3f) << slant << ' ' << aside;
      EXPECT_LT(fiber.albedo().y, fiber.albedo().x);
      EXPECT_LT(fiber.albedo().z, fiber.albedo().y);
    }
  }
}

TEST(HairFiber, ShowsAnEvenSkyAsBrightAsItIs) {
  for (const float roughness : {0.15f, 0.3f, 0.6f}) {
    for (const double aside : {0.0, 0.8}) {
      const HairFiber fiber(hair_of(roughness), {0, 0, 0}, direction_at(0.4, 0.0), aside, 0.0f);
      const double seen =
          integral([&](const HairDirection& at) { return static_cast<double>(fiber.evaluate(at).share.x); });
      EXPECT_NEAR(seen, 1.0, 0.01) << roughness << ' ' << aside;
    }
  }
}

// Tilted scales turn a lobe. Its values stay the same, but the solid angles do not: hence the larger tolerance.
TEST(HairFiber, ChoosesDirectionsAsOftenAsItSays) {
  for (const float tilt : {0.0f, 0.035f}) {
    const HairFiber fiber(hair_of(0.25f, tilt), {0.1f, 0.3f, 1.0f}, direction_at(0.5, 0.0), -0.6, 0.0f);
    expect_agreement(
        [&](const HairDirection& at) { return fiber.evaluate(at).density; },
        [&](std::uint32_t i) { return fiber.sample(static_cast<double>(random(i, 7).x), random(i, 1)).direction; },
        tilt > 0.0f ? 0.02 : 0.01, "tilt " + std::to_string(tilt));
  }
}

TEST(HairFiber, IsNoNarrowerThanIsAsked) {
  const HairDirection view = direction_at(0.2, 0.0), beside = direction_at(0.3, 0.9);
  const HairFiber narrow(hair_of(0.05f), {0, 0, 0}, view, 0.0, 0.0f);
  const HairFiber widened(hair_of(0.05f), {0, 0, 0}, view, 0.0, 0.4f);
  EXPECT_GT(widened.evaluate(beside).density, 10.0 * narrow.evaluate(beside).density);
}

// A strand of both shares: the mean of the samples is the brightness under an even sky.
TEST(HairBsdf, WeighsItsSamplesByWhatIsSeen) {
  Hair hair = hair_of(0.3f);
  hair.surface = 0.2f, hair.fiber = 0.3f;
  const Vec3f view = normalized(Vec3f{0.4f, 0.5f, 0.7f}), along{1, 0, 0}, up{0, 0, 1};
  Material material{.color = {0.5f, 0.5f, 0.5f}};
  material.surface = hair.surface;
  Bsdf bsdf(material, up, up, view, false, {});
  bsdf.add_hair({hair, material.color, {along, up, view}, 0.0f});
  constexpr std::uint32_t kSamples = 1 << 15;
  Vec3d sum{0, 0, 0};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const Bsdf::Sample sample = bsdf.sample(random(i, 5).x, random(i, 6));
    sum = sum + to_double(sample.weight);
  }
  const Vec3d seen = sum * (1.0 / kSamples);
  EXPECT_NEAR(seen.x, 0.1 + 0.3, 0.01);
  EXPECT_NEAR(seen.y, 0.1 + 0.3, 0.01);
  EXPECT_NEAR(seen.z, 0.1 + 0.3, 0.01);
}

}  // namespace
}  // namespace perfect_bvh
