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

Vec3f view_at(std::size_t cosine) noexcept {
  const float upwards = std::max(static_cast<float>(cosine) / (kFacetSteps - 1), kLeastCosine);
  return {std::sqrt(1.0f - upwards * upwards), 0.0f, upwards};
}
Facets facets_at(std::size_t roughness) noexcept {
  const float rough = static_cast<float>(roughness) / (kFacetSteps - 1);
  return Facets(std::max(rough * rough, kLeastAlpha));
}

float sum_of_panes(const Facets& facets, Vec3f view, float ior) noexcept {
  constexpr std::uint32_t kPaneSamples = 64;
  float sum = 0.0f;
  for (std::uint32_t i = 0; i < kPaneSamples; ++i) {
    const Vec3f normal = facets.choose_seen(view, sampling::scrambled_sobol(i, 0).to_unit());
    const float slant = dot(view, normal), out = 2.0f * slant * normal.z - view.z;
    const Fresnel boundary = fresnel(slant, ior);
    const float down = (view.z - normal.z * slant) / ior + normal.z * boundary.cosine;
    if (out > 0.0f) sum += boundary.reflected * facets.lit_of_seen(view.z, out);
    if (down > 0.0f) sum += (1.0f - boundary.reflected) * facets.lit_of_seen(view.z, down);
  }
  return sum / kPaneSamples;
}

// The mean over the cosines of a row, each as likely as itself: trapezoids.
float mean_of(const FacetRow& row) noexcept {
  float sum = 0.0f, weight = 0.0f;
  for (std::size_t cosine = 0; cosine < kFacetSteps; ++cosine) {
    const float at = static_cast<float>(cosine) * (cosine + 1 == kFacetSteps ? 0.5f : 1.0f);
    sum += at * row[cosine], weight += at;
  }
  return sum / weight;
}
FacetRow means_of(const FacetTable& table) noexcept {
  FacetRow means;
  std::transform(table.begin(), table.end(), means.begin(), mean_of);
  return means;
}
float look_up_mean(const FacetRow& means, float roughness) noexcept {
  const Cell row = cell_at(roughness, kFacetSteps);
  return between(means[row.low], means[row.high], row.part);
}

// By index, of glass seen from outside or from inside.
struct PaneTables {
  std::array<FacetTable, kFacetSteps> shares;
  std::array<FacetRow, kFacetSteps> means;

  explicit PaneTables(bool inside) {
    for (std::size_t step = 0; step < kFacetSteps; ++step) {
      const float ior = ior_at(static_cast<float>(step) / (kFacetSteps - 1));
      for (std::size_t row = 0; row < kFacetSteps; ++row) {
        for (std::size_t column = 0; column < kFacetSteps; ++column) {
          shares[step][row][column] = sum_of_panes(facets_at(row), view_at(column), inside ? 1.0f / ior : ior);
        }
      }
      means[step] = means_of(shares[step]);
    }
  }
};

}  // namespace

FacetShare share_of_mirrors(float cosine, float roughness) noexcept {
  const FacetAlbedo& albedo = FacetAlbedo::tables();
  return {albedo.of_mirrors(cosine, roughness), albedo.mean_of_mirrors(roughness)};
}

FacetShare share_of_panes(float cosine, float roughness, float ior) {
  static const PaneTables outside(false), inside(true);
  const bool is_inside = ior < 1.0f;
  const PaneTables& tables = is_inside ? inside : outside;
  const Cell layer = cell_at(place_of(is_inside ? 1.0f / ior : ior), kFacetSteps);
  return {between(look_up(tables.shares[layer.low], cosine, roughness),
                  look_up(tables.shares[layer.high], cosine, roughness), layer.part),
          between(look_up_mean(tables.means[layer.low], roughness), look_up_mean(tables.means[layer.high], roughness),
                  layer.part)};
}

const FacetAlbedo& FacetAlbedo::tables() {
  static const FacetAlbedo made;
  return made;
}

FacetAlbedo::FacetAlbedo() {
  for (int roughness = 0; roughness < kFacetSteps; ++roughness) {
    for (int cosine = 0; cosine < kFacetSteps; ++cosine) fill(roughness, cosine);
  }
  means_ = means_of(mirrors_);
}

void FacetAlbedo::fill(int roughness, int cosine) {
  const auto row = static_cast<std::size_t>(roughness), column = static_cast<std::size_t>(cosine);
  const Facets facets = facets_at(row);
  const Vec3f view = view_at(column);
  float all = 0.0f, metal = 0.0f;
  FacetRow dielectric{};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const Vec3f normal = facets.choose_seen(view, sampling::scrambled_sobol(i, 0).to_unit());
    const float slant = dot(view, normal), out = 2.0f * slant * normal.z - view.z;
    if (!(out > 0.0f)) continue;
    const float leaves = facets.lit_of_seen(view.z, out);
    all += leaves, metal += leaves * schlick_rise(slant);
    for (std::size_t step = 0; step < kFacetSteps; ++step) {
      const float ior = ior_at(static_cast<float>(step) / (kFacetSteps - 1)), least = reflectance_of(ior);
      dielectric[step] += leaves * (fresnel(slant, ior).reflected - least) / (1.0f - least);
    }
  }
  mirrors_[row][column] = all / kSamples;
  metals_[row][column] = all > 0.0f ? metal / all : 1.0f;
  for (std::size_t step = 0; step < kFacetSteps; ++step) {
    dielectrics_[step][row][column] = all > 0.0f ? std::clamp(dielectric[step] / all, 0.0f, 1.0f) : 1.0f;
  }
}

float look_up(const FacetTable& table, float cosine, float roughness) noexcept {
  const Cell row = cell_at(roughness, kFacetSteps), column = cell_at(cosine, kFacetSteps);
  const FacetRow &low = table[row.low], &high = table[row.high];
  return between(between(low[column.low], low[column.high], column.part),
                 between(high[column.low], high[column.high], column.part), row.part);
}

float FacetAlbedo::mean_of_mirrors(float roughness) const noexcept { return look_up_mean(means_, roughness); }

float FacetAlbedo::dielectric_rise(float cosine, float roughness, float ior) const noexcept {
  const Cell layer = cell_at(place_of(ior), kFacetSteps);
  return between(look_up(dielectrics_[layer.low], cosine, roughness),
                 look_up(dielectrics_[layer.high], cosine, roughness), layer.part);
}

Vec3f with_what_bounces(Vec3f color, const FacetShare& share, float kept) noexcept {
  const float once = std::max(share.here, 1e-3f), missing = kept * (1.0f - once) / once;
  const auto gain = [&](float channel) {
    return 1.0f + missing * channel * share.mean / (1.0f - channel * (1.0f - share.mean));
  };
  return {gain(color.x), gain(color.y), gain(color.z)};
}

}  // namespace perfect_bvh
