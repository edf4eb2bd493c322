#include "render/surface/microfacets.h"

#include "render/surface/fresnel.h"

namespace perfect_bvh {
namespace {

constexpr int kSamples = 128;
constexpr float kLeastAlpha = 1e-4f, kLeastCosine = 1e-3f;

// The fourth root of the reflectance: even steps of it are even steps of the eye.
float ior_at(float place) noexcept {
  const float root = std::min(place, 0.995f);
  return (1.0f + root * root) / (1.0f - root * root);
}
float place_of(float ior) noexcept { return std::sqrt(std::max((ior - 1.0f) / (ior + 1.0f), 0.0f)); }

struct Cell {
  std::size_t low, high;
  float part;
};
Cell cell_at(float place, int steps) noexcept {
  const float scaled = std::clamp(place, 0.0f, 1.0f) * static_cast<float>(steps - 1);
  const auto low = static_cast<std::size_t>(scaled);
  return {low, std::min(low + 1, static_cast<std::size_t>(steps - 1)), scaled - static_cast<float>(low)};
}
float between(float low, float high, float part) noexcept { return low + (high - low) * part; }

}  // namespace

const FacetAlbedo& FacetAlbedo::tables() {
  static const FacetAlbedo made;
  return made;
}

FacetAlbedo::FacetAlbedo() {
  for (int roughness = 0; roughness < kSteps; ++roughness) {
    float sum = 0.0f, weight = 0.0f;
    for (int cosine = 0; cosine < kSteps; ++cosine) {
      fill(roughness, cosine);
      const float at = static_cast<float>(cosine) * (cosine + 1 == kSteps ? 0.5f : 1.0f);  // trapezoids
      sum += at * mirrors_[static_cast<std::size_t>(roughness)][static_cast<std::size_t>(cosine)], weight += at;
    }
    means_[static_cast<std::size_t>(roughness)] = sum / weight;
  }
}

void FacetAlbedo::fill(int roughness, int cosine) {
  const auto row = static_cast<std::size_t>(roughness), column = static_cast<std::size_t>(cosine);
  const float rough = static_cast<float>(roughness) / (kSteps - 1);
  const float upwards = std::max(static_cast<float>(cosine) / (kSteps - 1), kLeastCosine);
  const Facets facets(std::max(rough * rough, kLeastAlpha));
  const Vec3f view{std::sqrt(1.0f - upwards * upwards), 0.0f, upwards};
  float all = 0.0f, metal = 0.0f;
  std::array<float, kSteps> dielectric{};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const Vec3f normal = facets.choose_seen(view, sampling::scrambled_sobol(i, 0).to_unit());
    const float slant = dot(view, normal), out = 2.0f * slant * normal.z - view.z;
    if (!(out > 0.0f)) continue;
    const float leaves = facets.lit_of_seen(upwards, out);
    all += leaves, metal += leaves * schlick_rise(slant);
    for (std::size_t step = 0; step < kSteps; ++step) {
      const float ior = ior_at(static_cast<float>(step) / (kSteps - 1)), least = reflectance_of(ior);
      dielectric[step] += leaves * (fresnel(slant, ior).reflected - least) / (1.0f - least);
    }
  }
  mirrors_[row][column] = all / kSamples;
  metals_[row][column] = all > 0.0f ? metal / all : 1.0f;
  for (std::size_t step = 0; step < kSteps; ++step) {
    dielectrics_[step][row][column] = all > 0.0f ? std::clamp(dielectric[step] / all, 0.0f, 1.0f) : 1.0f;
  }
}

float FacetAlbedo::look_up(const Table& table, float cosine, float roughness) noexcept {
  const Cell row = cell_at(roughness, kSteps), column = cell_at(cosine, kSteps);
  const Row &low = table[row.low], &high = table[row.high];
  return between(between(low[column.low], low[column.high], column.part),
                 between(high[column.low], high[column.high], column.part), row.part);
}

float FacetAlbedo::mean_of_mirrors(float roughness) const noexcept {
  const Cell row = cell_at(roughness, kSteps);
  return between(means_[row.low], means_[row.high], row.part);
}

float FacetAlbedo::dielectric_rise(float cosine, float roughness, float ior) const noexcept {
  const Cell layer = cell_at(place_of(ior), kSteps);
  return between(look_up(dielectrics_[layer.low], cosine, roughness),
                 look_up(dielectrics_[layer.high], cosine, roughness), layer.part);
}

Vec3f with_what_bounces(Vec3f mean_reflectance, float cosine, float roughness) noexcept {
  const FacetAlbedo& albedo = FacetAlbedo::tables();
  const float once = std::max(albedo.of_mirrors(cosine, roughness), 1e-3f), mean = albedo.mean_of_mirrors(roughness);
  const float missing = (1.0f - once) / once;
  const auto gain = [&](float fresnel) { return 1.0f + missing * fresnel * mean / (1.0f - fresnel * (1.0f - mean)); };
  return {gain(mean_reflectance.x), gain(mean_reflectance.y), gain(mean_reflectance.z)};
}

}  // namespace perfect_bvh
