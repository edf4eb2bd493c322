// Highlights and mirrors: that the ways to sample them agree with what they sample, and with each other.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/appearance/light.h"
#include "render/light/multiple_importance.h"
#include "render/sampling/sampler.h"
#include "render/surface/specular.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::array kRoughnesses{0.05f, 0.15f, 0.3f, 0.45f, 0.6f, 0.9f};
const Vec3f kUp{0, 0, 1};

Specular metal(float roughness, float slant) { return {{1, 1, 1}, roughness, {std::sin(slant), 0, std::cos(slant)}}; }

Point2 random(std::uint32_t index, std::uint32_t seed = 1) { return sampling::scrambled_sobol(index, seed).to_unit(); }

// Sums a value and its squares.
struct Estimate {
  double sum = 0.0, squares = 0.0;
  int count = 0;
  void add(double value) { sum += value, squares += value * value, ++count; }
  double mean() const { return sum / count; }
  double error() const { return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count); }
};

std::array<Light, 5> lights() {
  std::array<Light, 5> made;
  for (int i = 0; i < 5; ++i) {
    Light& light = made[static_cast<std::size_t>(i)];
    light.kind = static_cast<LightKind>(i);
    light.position = {-2.0, 0.5, 3.0};
    light.x = {1, 0, 0}, light.y = {0, 1, 0};
    light.power = {50, 40, 30};
    light.size_x = 0.7f, light.size_y = 0.4f;
  }
  Light& sun = made[static_cast<int>(LightKind::kSun)];
  sun.z = normalized(Vec3f{-2.0f, 0.5f, 3.0f});
  sun.x = normalized(cross(Vec3f{0, 1, 0}, sun.z)), sun.y = cross(sun.z, sun.x);
  sun.size_x = 0.05f;
  made[static_cast<int>(LightKind::kEllipse)].spread = 1.2f;
  Light& spot = made[static_cast<int>(LightKind::kSpot)];
  spot.cone_cosine = 0.5f, spot.cone_blend = 0.5f;
  return made;
}

TEST(Specular, MirroredDirectionsHaveTheDensityThatHighlightsTell) {
  for (const float roughness : kRoughnesses) {
    for (const float slant : {0.0f, 0.6f, 1.3f}) {
      const Specular specular = metal(roughness, slant);
      for (std::uint32_t i = 0; i < 256; ++i) {
        const Mirrored way = mirrored(specular, kUp, random(i));
        if (!(way.direction.z > 0.02f) || way.weight.x == 0.0f) continue;
        const Highlight seen = highlight(specular, kUp, way.direction);
        // Near the horizon and in narrow lobes the half vector is known to fewer digits.
        EXPECT_NEAR(seen.density / way.density, 1.0f, 0.02f) << roughness << ' ' << slant << ' ' << i;
        const float weight = seen.share.x * way.direction.z / (kPi * seen.density);
        EXPECT_NEAR(weight / way.weight.x, 1.0f, 0.02f);
      }
    }
  }
}

// Over all directions, those below the horizon included, that facets mirror.
TEST(Specular, DensityIntegratesToOne) {
  constexpr std::uint32_t kCount = 1u << 18;
  for (const float roughness : kRoughnesses) {
    for (const float slant : {0.0f, 0.6f, 1.3f}) {
      const Specular specular = metal(roughness, slant);
      // Spread over the lobe's own width round the mirror's direction, so that narrow lobes are seen.
      double sum = 0.0;
      const Vec3f axis{-std::sin(slant), 0, std::cos(slant)}, side{0, 1, 0}, across = cross(side, axis);
      for (std::uint32_t i = 0; i < kCount; ++i) {
        const Point2 at = random(i);
        // 1 - cosine = 2 x^4: dense about the axis.
        const float fall = 2.0f * at.x * at.x * at.x * at.x, cosine = 1.0f - fall;
        const float sine = std::sqrt(std::max(0.0f, fall * (2.0f - fall))), angle = 2.0f * kPi * at.y;
        const Vec3f to = axis * cosine + across * (sine * std::cos(angle)) + side * (sine * std::sin(angle));
        if (!((specular.view + to).z > 0.0f)) continue;  // no facet mirrors there
        const double stretch = 2.0 * std::numbers::pi * 8.0 * std::pow(static_cast<double>(at.x), 3.0);
        sum += static_cast<double>(highlight(specular, kUp, to).density) * stretch;
      }
      EXPECT_NEAR(sum / kCount, 1.0, 0.02) << roughness << ' ' << slant;
    }
  }
}

// A white metal in a white furnace gives back nearly all; only what is thrown below the horizon is lost.
TEST(Specular, WhiteFurnaceKeepsItsEnergy) {
  for (const float roughness : kRoughnesses) {
    Estimate furnace;
    for (std::uint32_t i = 0; i < 4096; ++i) {
      furnace.add(static_cast<double>(mirrored(metal(roughness, 0.3f), kUp, random(i)).weight.x));
    }
    EXPECT_LT(furnace.mean(), 1.0 + 4.0 * furnace.error() + 0.02) << roughness;
    EXPECT_GT(furnace.mean(), roughness > 0.8f ? 0.6 : 0.93) << roughness;
  }
}

TEST(Lights, DirectionsThatAreChosenLeadToTheLightAndHaveItsDensity) {
  for (const Light& light : lights()) {
    for (std::uint32_t i = 0; i < 256; ++i) {
      const LightRay ray = look_at_light(light, {0, 0, 0}, kUp, random(i));
      // The border itself may round to either side.
      const Vec3f inward = normalized(ray.direction * 0.999f + normalized(Vec3f{-2.0f, 0.5f, 3.0f}) * 0.001f);
      const auto met = meet_light(light, {0, 0, 0}, inward);
      ASSERT_TRUE(met) << static_cast<int>(light.kind);
      EXPECT_NEAR(met->density / ray.density, 1.0f, 0.01f) << static_cast<int>(light.kind);
      EXPECT_NEAR(met->radiance.x * ray.direction.z / (kPi * ray.density * ray.light.x), 1.0f, 0.01f);
      if (std::isfinite(ray.length)) {
        EXPECT_NEAR(met->length / ray.length, 1.0f, 0.01f);
      }
    }
  }
}

// Over all directions the density of a light is 1: the share of even directions that meet it, weighted.
TEST(Lights, DensityIntegratesToOne) {
  for (const Light& light : lights()) {
    Estimate estimate;
    const Vec3f axis = normalized(Vec3f{-2.0f, 0.5f, 3.0f});
    const Vec3f side = normalized(cross(axis, kUp)), across = cross(side, axis);
    constexpr float kCap = 0.15f;  // 1 - cosine of the cap round the light
    for (std::uint32_t i = 0; i < (1u << 16); ++i) {
      const Point2 at = random(i);
      const float cosine = 1.0f - kCap * at.x, sine = std::sqrt(1.0f - cosine * cosine), angle = 2.0f * kPi * at.y;
      const Vec3f to = axis * cosine + across * (sine * std::cos(angle)) + side * (sine * std::sin(angle));
      const auto met = meet_light(light, {0, 0, 0}, to);
      estimate.add(met ? static_cast<double>(met->density * 2.0f * kPi * kCap) : 0.0);
    }
    EXPECT_NEAR(estimate.mean(), 1.0, 0.02) << static_cast<int>(light.kind);
  }
}

TEST(Lights, APointIsOnlyAimedAt) {
  for (Light light : lights()) {
    light.size_x = light.size_y = 0.0f;
    const LightRay ray = look_at_light(light, {0, 0, 0}, kUp, {0.3f, 0.7f});
    EXPECT_FALSE(meet_light(light, {0, 0, 0}, ray.direction));
    EXPECT_EQ(balance(ray.density, 800.0f), 1.0f);
  }
}

// What a metal shows of a light: by aiming alone, by looking where it mirrors alone, and by both.
TEST(Lights, BothWaysTogetherGiveWhatEachGivesAlone) {
  for (const Light& light : lights()) {
    for (const float roughness : kRoughnesses) {
      const Specular specular{{0.9f, 0.8f, 0.7f}, roughness, normalized(Vec3f{1.6f, -0.3f, 3.0f})};
      Estimate aimed, met_alone, both;
      for (std::uint32_t i = 0; i < (1u << 15); ++i) {
        const LightRay ray = look_at_light(light, {0, 0, 0}, kUp, random(i, 7));
        const Highlight seen = highlight(specular, kUp, ray.direction);
        const double aims = static_cast<double>(ray.light.y * seen.share.y);
        const Mirrored way = mirrored(specular, kUp, random(i, 9));
        const auto met = meet_light(light, {0, 0, 0}, way.direction);
        const double meets = met ? static_cast<double>(met->radiance.y * way.weight.y) : 0.0;
        aimed.add(aims), met_alone.add(meets);
        both.add(aims * static_cast<double>(balance(ray.density, seen.density)) +
                 (met ? meets * static_cast<double>(balance(way.density, met->density)) : 0.0));
      }
      const double error = std::hypot(aimed.error(), both.error());
      EXPECT_NEAR(both.mean(), aimed.mean(), 5.0 * error + 0.01 * aimed.mean())
          << static_cast<int>(light.kind) << ' ' << roughness;
      EXPECT_NEAR(both.mean(), met_alone.mean(), 5.0 * std::hypot(met_alone.error(), both.error()) + 0.01 * both.mean())
          << static_cast<int>(light.kind) << ' ' << roughness;
      // Never much worse than the better of the two: by no more than theorem 9.2 of Veach's thesis (1997) allows.
      const double better = std::min(aimed.error(), met_alone.error());
      EXPECT_LT(both.error(), 1.05 * std::hypot(better, both.mean() * std::sqrt(0.5 / both.count)));
    }
  }
}

}  // namespace
}  // namespace perfect_bvh
