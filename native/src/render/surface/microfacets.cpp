#include "render/surface/microfacets.h"

namespace perfect_bvh {
namespace {

constexpr int kSamples = 128;
constexpr float kLeastAlpha = 1e-4f, kLeastCosine = 1e-3f;

// The fourth root of the reflectance: equal steps of it look equal.
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
    const float slant = dot(view, normal);
    const Fresnel boundary = fresnel(slant, ior);
    const Vec3f out = normal * (2.0f * slant) - view;
    const Vec3f down = (view - normal * slant) * (1.0f / ior) + normal * boundary.cosine;
    if (out.z > 0.0f) sum += boundary.reflected * facets.lit_of_seen(view, out, normal);
    if (down.z > 0.0f) sum += (1.0f - boundary.reflected) * facets.lit_of_seen(view, down, normal);
  }
  return sum / kPaneSamples;
}

// The mean over the cosines of a row, weighted by the cosine: trapezoids.
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

// By index, for glass seen from outside or from inside.
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

// The exponent of Ashikhmin and Shirley's lobe (2000), from its approximate width of slopes.
float exponent_of(float alpha) noexcept { return 2.0f / (alpha * alpha) - 2.0f; }

// Smith's function for Beckmann's slopes, by the fit of Walter et al. 2007.
float hidden_of_beckmann(float steepness) noexcept {
  const float a = 1.0f / std::sqrt(std::max(steepness, 1e-12f));
  return a < 1.6f ? (1.0f - 1.259f * a + 0.396f * a * a) / (3.535f * a + 2.181f * a * a) : 0.0f;
}

}  // namespace

float Facets::density_of_other(Vec3f normal) const noexcept {
  constexpr double kPi = std::numbers::pi;
  const double x = static_cast<double>(normal.x), y = static_cast<double>(normal.y);
  const double z = std::max(static_cast<double>(normal.z), 1e-6), flat = std::max(x * x + y * y, 1e-24);
  if (kind_ == FacetKind::kBeckmann) {
    const double along = x / static_cast<double>(along_), across = y / static_cast<double>(across_);
    const double steep = (along * along + across * across) / (z * z);
    return static_cast<float>(exponential(-steep) / (kPi * static_cast<double>(product_) * z * z * z));
  }
  const auto along = static_cast<double>(exponent_of(along_)), across = static_cast<double>(exponent_of(across_));
  const double exponent = (along * x * x + across * y * y) / flat;
  return static_cast<float>(std::sqrt((along + 1.0) * (across + 1.0)) / (2.0 * kPi) *
                            exponential(exponent * logarithm(z)));
}

float Facets::lit_of_other(Vec3f view, Vec3f light, Vec3f normal) const noexcept {
  const float down = std::abs(light.z);
  if (kind_ == FacetKind::kAshikhminShirley) return down / std::max(view.z, down);
  const float hidden = hidden_of_beckmann(steepness(view)) + hidden_of_beckmann(steepness(light));
  return std::max(dot(view, normal), 0.0f) / (view.z * std::max(normal.z, 1e-6f) * (1.0f + hidden));
}

Vec3f Facets::choose_other(Point2 random) const noexcept {
  const auto [sine, cosine] = sine_cosine(2.0f * std::numbers::pi_v<float> * random.x);
  const double rest = std::max(1.0 - static_cast<double>(random.y), 1e-9);
  if (kind_ == FacetKind::kBeckmann) {
    const auto slope = static_cast<float>(std::sqrt(-logarithm(rest)));
    return normalized(Vec3f{along_ * slope * cosine, across_ * slope * sine, 1.0f});
  }
  const float along = exponent_of(along_), across = exponent_of(across_);
  const float x = std::sqrt(across + 1.0f) * cosine, y = std::sqrt(along + 1.0f) * sine;
  const float square = x * x + y * y, exponent = (along * x * x + across * y * y) / square;
  const auto z = static_cast<float>(exponential(logarithm(rest) / (static_cast<double>(exponent) + 1.0)));
  const float flat = std::sqrt(std::max(1.0f - z * z, 0.0f) / square);
  return {x * flat, y * flat, z};
}

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
    const float slant = dot(view, normal);
    const Vec3f out = normal * (2.0f * slant) - view;
    if (!(out.z > 0.0f)) continue;
    const float leaves = facets.lit_of_seen(view, out, normal);
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
