// Surfaces that scatter, and lights: sampling agrees with evaluation, and the sampling strategies with each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "render/appearance/light.h"
#include "render/light/next_event.h"
#include "render/sampling/sampler.h"
#include "render/surface/bsdf.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr std::array kRoughnesses{0.05f, 0.15f, 0.3f, 0.45f, 0.6f, 0.9f};
const Vec3f kUp{0, 0, 1};

struct Surface {
  const char* name;
  Material material;
};

Material metal(float roughness) {
  return {.color = {1, 1, 1}, .roughness = roughness, .metallic = 1.0f, .metal = {1, 1, 1}};
}
Material plastic(float roughness) {
  return {.color = {0.8f, 0.6f, 0.4f}, .roughness = roughness, .reflectance = 0.04f};
}
Material glass(float roughness) {
  return {.color = {1, 1, 1}, .roughness = roughness, .reflectance = 0.04f, .transmission = 1.0f, .ior = 1.45f};
}
// A material that has every lobe.
Material mixture(float roughness) {
  return {.color = {0.8f, 0.6f, 0.4f},
          .roughness = roughness,
          .metallic = 0.3f,
          .metal = {0.9f, 0.7f, 0.3f},
          .even_metal = 0.5f,
          .reflectance = 0.08f,
          .specular_tint = {1.0f, 0.8f, 0.6f},
          .transmission = 0.4f,
          .ior = 1.33f,
          .tint = {0.9f, 1.0f, 0.8f},
          .tinted_glass = 0.5f,
          .plain_refraction = 0.5f,
          .lossy_facets = 0.5f,
          .translucency = 0.3f,
          .translucent = {0.1f, 0.05f, 0.02f}};
}
// Brushed obliquely, rough below its facets, and covered by a tinted coat and by fibers.
Material finished(float roughness) {
  Material made = mixture(roughness);
  made.finish = Finish{.sheen = {0.5f, 0.7f, 0.3f},
                       .sheen_roughness = 0.2f + 0.8f * roughness,
                       .coat = 0.7f,
                       .coat_roughness = 0.4f,
                       .coat_ior = 1.8f,
                       .coat_tint = {0.9f, 0.7f, 0.5f},
                       .stretch = 1.5f,
                       .rotation = 0.1f,
                       .diffuse_roughness = 0.8f};
  made.tangent = {0.6f, 0.8f, 0.0f}, made.coat_normal = normalized(Vec3f{0.1f, -0.1f, 1.0f});
  return made;
}
// Brushed metal of this distribution, or glass.
Material faceted(float roughness, FacetKind kind, bool is_glass = false) {
  Material made = is_glass ? glass(roughness) : metal(roughness);
  made.lossy_facets = 1.0f;
  made.finish = Finish{.stretch = is_glass ? 1.0f : 0.8f, .distribution = static_cast<float>(kind)};
  made.tangent = {0, 1, 0};
  return made;
}
std::array<Surface, 8> surfaces(float roughness) {
  return {{{"metal", metal(roughness)},
           {"plastic", plastic(roughness)},
           {"glass", glass(roughness)},
           {"mixture", mixture(roughness)},
           {"finished", finished(roughness)},
           {"Beckmann metal", faceted(roughness, FacetKind::kBeckmann)},
           {"Beckmann glass", faceted(roughness, FacetKind::kBeckmann, true)},
           {"Ashikhmin-Shirley metal", faceted(roughness, FacetKind::kAshikhminShirley)}}};
}
Vec3f view_at(float slant) { return {std::sin(slant), 0, std::cos(slant)}; }
Bsdf bsdf_of(const Material& material, Vec3f view, bool inside = false) {
  return {material, kUp, kUp, view, inside, {}};
}

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

float pick(std::uint32_t index) { return random(index, 31).x; }

// At the ends of random numbers, directions lie in the surface: a height of rounding alone must not brighten a pixel.
TEST(Bsdf, DirectionsInTheSurfaceAreNotBright) {
  for (const Surface& surface : surfaces(0.5f)) {
    for (const Vec3f& normal : {kUp, normalized(Vec3f{0.3f, -0.2f, 1.0f}), normalized(Vec3f{-0.7f, 0.1f, 0.4f})}) {
      const Bsdf bsdf(surface.material, normal, normal, normalized(normal + Vec3f{0.3f, 0.1f, 0}), false, {});
      for (std::uint32_t i = 0; i < 4096; ++i) {
        for (const float end : {0.0f, 0x1p-32f, 0x1p-24f, 1.0f - 0x1p-24f}) {
          for (const Point2 at : {Point2{end, random(i).y}, Point2{random(i).y, end}}) {
            const Bsdf::Sample way = bsdf.sample(pick(i), at);
            if (way.kind != Scatter::kDiffuse && way.kind != Scatter::kTranslucent) continue;
            ASSERT_LT(std::max({way.weight.x, way.weight.y, way.weight.z}), 50.0f)
                << surface.name << ", " << at.x << ", " << at.y;
          }
        }
      }
    }
  }
}

TEST(Bsdf, DirectionsThatAreSampledHaveTheDensityAndTheWeightThatEvaluationTells) {
  for (const float roughness : kRoughnesses) {
    for (const Surface& surface : surfaces(roughness)) {
      for (const float slant : {0.0f, 0.6f, 1.3f}) {
        const Bsdf bsdf = bsdf_of(surface.material, view_at(slant));
        for (std::uint32_t i = 0; i < 256; ++i) {
          const Bsdf::Sample way = bsdf.sample(pick(i), random(i));
          if (way.kind == Scatter::kNone || std::abs(way.direction.z) < 0.02f) continue;
          const Bsdf::Value value = bsdf.evaluate(way.direction);
          EXPECT_NEAR(value.density / way.density, 1.0f, 0.02f) << surface.name << ' ' << roughness << ' ' << i;
          const float weight = value.share.x * std::abs(way.direction.z) / (kPi * value.density);
          EXPECT_NEAR(weight, way.weight.x, 0.02f * way.weight.x) << surface.name;
          const bool beyond = way.kind == Scatter::kTranslucent || way.kind == Scatter::kRefracted;
          EXPECT_EQ(way.direction.z < 0.0f, beyond) << surface.name;
        }
      }
    }
  }
}

// Directions spread evenly give the same result as sampling: no direction is chosen too rarely or too often.
void expect_same_by_sampling_as_from_everywhere(const Bsdf& bsdf, const std::string& name) {
  constexpr std::uint32_t kCount = 1u << 17;
  Estimate everywhere, sampled;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const Point2 at = random(i, 3);
    const float height = 2.0f * at.x - 1.0f, radius = std::sqrt(1.0f - height * height);
    const Vec3f to{radius * std::cos(2.0f * kPi * at.y), radius * std::sin(2.0f * kPi * at.y), height};
    // A light that is brighter on one side, so that directions matter.
    const float light = 1.0f + 0.5f * to.x;
    everywhere.add(static_cast<double>(bsdf.evaluate(to).share.y * std::abs(height) * 4.0f * light));
    const Bsdf::Sample way = bsdf.sample(pick(i), random(i, 5));
    sampled.add(way.kind == Scatter::kNone ? 0.0 : static_cast<double>(way.weight.y * (1.0f + 0.5f * way.direction.x)));
  }
  EXPECT_NEAR(sampled.mean(), everywhere.mean(), 6.0 * everywhere.error() + 0.01) << name;
}

TEST(Bsdf, SamplingGivesWhatAllDirectionsGive) {
  for (const float roughness : {0.45f, 0.6f, 0.9f}) {
    for (const Surface& surface : surfaces(roughness)) {
      for (const float slant : {0.1f, 0.6f, 1.2f}) {
        for (const bool inside : {false, true}) {
          const std::string name = std::string(surface.name) + ' ' + std::to_string(roughness) + ' ' +
                                   std::to_string(slant) + (inside ? " inside" : "");
          expect_same_by_sampling_as_from_everywhere(bsdf_of(surface.material, view_at(slant), inside), name);
        }
      }
    }
  }
}

// The triangle is tilted so much that facets are spread around another normal than the diffuse light.
TEST(Bsdf, SamplingGivesWhatAllDirectionsGiveWhereFacetsAreBent) {
  const Vec3f triangle = normalized(Vec3f{0.7f, 0.3f, 0.6f});
  const Vec3f view = view_at(1.2f);
  ASSERT_GT(length(bent_normal(kUp, triangle, view) - kUp), 0.1f);
  for (const float roughness : {0.45f, 0.6f, 0.9f}) {
    for (const Surface& surface : surfaces(roughness)) {
      const Bsdf bsdf(surface.material, kUp, triangle, view, false, {});
      expect_same_by_sampling_as_from_everywhere(bsdf, std::string(surface.name) + ' ' + std::to_string(roughness));
    }
  }
}

TEST(BentNormal, MirrorsWhatLiesAboveTheTriangleAndIsBentNoFurtherThanThat) {
  int bent_count = 0;
  for (std::uint32_t i = 0; i < 4096; ++i) {
    const Vec3f triangle = cosine_direction(kUp, random(i, 7)), view = cosine_direction(triangle, random(i, 8));
    const Vec3f smooth = cosine_direction(triangle, random(i, 9));
    const float least = std::min(0.9f * dot(view, triangle), 0.01f);
    const auto height = [&](Vec3f normal) { return dot(normal * (2.0f * dot(normal, view)) - view, triangle); };
    const Vec3f bent = bent_normal(smooth, triangle, view);
    if (height(smooth) >= least) {
      EXPECT_EQ(bent, smooth);
      continue;
    }
    ++bent_count;
    EXPECT_NEAR(length(bent), 1.0f, 1e-5f);
    EXPECT_NEAR(height(bent), least, 1e-5f);
    EXPECT_NEAR(dot(cross(smooth, triangle), bent), 0.0f, 1e-5f) << "it leaves the plane of both";
    EXPECT_GT(dot(bent, triangle), dot(smooth, triangle));
  }
  EXPECT_GT(bent_count, 500);
  EXPECT_EQ(bent_normal(kUp, kUp, view_at(1.5f)), kUp);
}

// In a white furnace, white surfaces reflect all light: light scattered between facets is not lost.
TEST(Bsdf, WhiteFurnaceKeepsItsEnergy) {
  for (const float roughness : {0.0f, 0.05f, 0.15f, 0.3f, 0.45f, 0.6f, 0.9f}) {
    for (const float slant : {0.0f, 0.6f, 1.2f}) {
      Material white = plastic(roughness);
      white.color = {1, 1, 1};
      for (const auto& [name, material] :
           {Surface{"metal", metal(roughness)}, {"plastic", white}, {"glass", glass(roughness)}}) {
        Estimate furnace;
        const Bsdf bsdf = bsdf_of(material, view_at(slant));
        for (std::uint32_t i = 0; i < 16384; ++i) {
          furnace.add(static_cast<double>(bsdf.sample(pick(i), random(i)).weight.x));
        }
        EXPECT_NEAR(furnace.mean(), 1.0, 5.0 * furnace.error() + 0.015) << name << ' ' << roughness << ' ' << slant;
      }
    }
  }
}

// The density integrated over all directions is the share of valid samples: the rest point below the surface.
TEST(Bsdf, DensityOfDirectionsIsThatOfSamples) {
  constexpr std::uint32_t kCount = 1u << 16;
  for (const Surface& surface : surfaces(0.6f)) {
    for (const float slant : {0.1f, 1.2f}) {
      const Bsdf bsdf = bsdf_of(surface.material, view_at(slant));
      Estimate density, found, aside;
      for (std::uint32_t i = 0; i < kCount; ++i) {
        const Point2 at = random(i, 3);
        const float height = 2.0f * at.x - 1.0f, radius = std::sqrt(1.0f - height * height);
        const Vec3f to{radius * std::cos(2.0f * kPi * at.y), radius * std::sin(2.0f * kPi * at.y), height};
        const auto chance = static_cast<double>(bsdf.evaluate(to).density * 4.0f * kPi);
        density.add(chance), aside.add(to.x > 0.0f ? chance : 0.0);
        const Bsdf::Sample way = bsdf.sample(pick(i), random(i, 5));
        found.add(way.kind == Scatter::kNone ? 0.0 : 1.0);
        aside.add(way.kind != Scatter::kNone && way.direction.x > 0.0f ? -1.0 : 0.0);
      }
      EXPECT_NEAR(density.mean(), found.mean(), 6.0 * density.error() + 0.01) << surface.name << ' ' << slant;
      EXPECT_NEAR(aside.mean(), 0.0, 6.0 * aside.error() + 0.01) << surface.name << ' ' << slant;
      EXPECT_LT(found.mean(), 1.0 + 1e-6);
    }
  }
}

// Rough diffuse white surfaces lose no light, and layers on top return no more than they received.
TEST(Bsdf, FinishesKeepTheirEnergy) {
  for (const float slant : {0.0f, 0.6f, 1.2f, 1.5f}) {
    for (const float roughness : {0.1f, 0.5f, 1.0f}) {
      Material rough{.color = {1, 1, 1}}, covered = rough;
      rough.finish = Finish{.diffuse_roughness = roughness};
      covered.finish =
          Finish{.sheen = {1, 1, 1}, .sheen_roughness = roughness, .coat = 1.0f, .coat_roughness = roughness};
      Estimate plain, below;
      const Bsdf bsdf = bsdf_of(rough, view_at(slant)), layered = bsdf_of(covered, view_at(slant));
      for (std::uint32_t i = 0; i < 16384; ++i) {
        plain.add(static_cast<double>(bsdf.sample(pick(i), random(i)).weight.x));
        below.add(static_cast<double>(layered.sample(pick(i), random(i)).weight.x));
      }
      EXPECT_NEAR(plain.mean(), 1.0, 5.0 * plain.error() + 0.005) << roughness << ' ' << slant;
      EXPECT_LT(below.mean(), 1.0 + 5.0 * below.error() + 0.005) << roughness << ' ' << slant;
      EXPECT_GT(below.mean(), 0.7) << roughness << ' ' << slant;
    }
  }
}

// Surfaces without layers are reciprocal. Layers depend only on the viewer's side, as in Cycles, and are not tested.
TEST(Bsdf, RoughAndBrushedSurfacesAreReciprocal) {
  for (const float roughness : {0.3f, 0.6f, 0.9f}) {
    Material rough{.color = {0.8f, 0.6f, 0.4f}};
    rough.finish = Finish{.diffuse_roughness = roughness};
    for (const Material& material :
         {rough, faceted(roughness, FacetKind::kGgx), faceted(roughness, FacetKind::kBeckmann),
          faceted(roughness, FacetKind::kAshikhminShirley)}) {
      for (std::uint32_t i = 0; i < 64; ++i) {
        const Vec3f a = cosine_direction(kUp, random(i, 7)), b = cosine_direction(kUp, random(i, 8));
        const float there = bsdf_of(material, a).evaluate(b).share.y, back = bsdf_of(material, b).evaluate(a).share.y;
        EXPECT_NEAR(there, back, 1e-3f * (there + back) + 1e-6f);
      }
    }
  }
}

TEST(Bsdf, SmoothSurfacesMirrorAndRefractByTheLaws) {
  const Vec3f view = view_at(0.7f);
  const Bsdf mirror = bsdf_of(metal(0.0f), view), pane = bsdf_of(glass(0.0f), view);
  const Bsdf::Sample mirrored = mirror.sample(0.5f, {0.3f, 0.4f});
  EXPECT_EQ(mirrored.kind, Scatter::kGlossy);
  EXPECT_NEAR(mirrored.direction.x, -view.x, 1e-6f);
  EXPECT_NEAR(mirrored.direction.z, view.z, 1e-6f);
  EXPECT_TRUE(std::isinf(mirrored.density));
  EXPECT_EQ(mirror.evaluate(mirrored.direction).density, 0.0f);
  const Bsdf::Sample refracted = pane.sample(0.99f, {0.3f, 0.4f});
  EXPECT_EQ(refracted.kind, Scatter::kRefracted);
  EXPECT_NEAR(refracted.direction.x, -view.x / 1.45f, 1e-6f);  // Snell
  EXPECT_LT(refracted.direction.z, 0.0f);
  // Total reflection.
  EXPECT_EQ(bsdf_of(glass(0.0f), view_at(1.0f), true).sample(0.99f, {0.3f, 0.4f}).kind, Scatter::kGlossy);
}

TEST(Bsdf, LimitsLeaveOutWhatTheyName) {
  const Vec3f view = view_at(0.3f);
  const Bsdf neither(glass(0.1f), kUp, kUp, view, false, {.no_reflection = true, .no_refraction = true});
  EXPECT_TRUE(neither.is_black());
  const Bsdf wide(metal(0.0f), kUp, kUp, view, false, {.least_alpha = 0.3f});
  EXPECT_FALSE(std::isinf(wide.sample(0.5f, {0.3f, 0.4f}).density));
}

TEST(Lights, DirectionsThatAreChosenLeadToTheLightAndHaveItsDensity) {
  for (const Light& light : lights()) {
    for (std::uint32_t i = 0; i < 256; ++i) {
      const LightRay ray = look_at_light(light, {0, 0, 0}, kUp, random(i));
      // Exactly on the border, rounding may choose either side.
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

// The density of a light integrates to 1 over all directions: the share of even directions that hit it, weighted.
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

// A light's reflection in metal: by sampling the light only, by sampling the surface only, and by both.
TEST(Lights, BothWaysTogetherGiveWhatEachGivesAlone) {
  for (const Light& light : lights()) {
    for (const float roughness : kRoughnesses) {
      Material gold = metal(roughness);
      gold.metal = {0.9f, 0.8f, 0.7f};
      const Bsdf bsdf = bsdf_of(gold, normalized(Vec3f{1.6f, -0.3f, 3.0f}));
      Estimate aimed, met_alone, both;
      for (std::uint32_t i = 0; i < (1u << 15); ++i) {
        const LightRay ray = look_at_light(light, {0, 0, 0}, kUp, random(i, 7));
        const Bsdf::Value seen = bsdf.evaluate(ray.direction);
        const double aims = static_cast<double>(ray.light.y * seen.share.y);
        const Bsdf::Sample way = bsdf.sample(0.5f, random(i, 9));
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
      // Never much worse than the better of the two: within the bound of theorem 9.2 of Veach's thesis (1997).
      const double better = std::min(aimed.error(), met_alone.error());
      EXPECT_LT(both.error(), 1.05 * std::hypot(better, both.mean() * std::sqrt(0.5 / both.count)));
    }
  }
}

}  // namespace
}  // namespace perfect_bvh
