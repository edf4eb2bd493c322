#include "render/surface/bsdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/surface/microfacets.h"

namespace perfect_bvh {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kLeastCosine = 1e-4f;
constexpr Vec3f kWhite{1, 1, 1};
constexpr float kSharpest = 0.075f;  // roughness of what a denoiser's guides look through, as in Cycles

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

}  // namespace

Bsdf::Bsdf(const Material& material, Vec3f normal, Vec3f geometric_normal, Vec3f view, bool inside,
           const Limits& limits) noexcept
    : frame_(bent_normal(normal, geometric_normal, view)),
      normal_(local(normal)),
      view_(local(view)),
      alpha_(std::max(material.roughness * material.roughness, limits.least_alpha)),
      roughness_(material.roughness),
      kept_(1.0f - material.lossy_facets) {
  view_.z = std::max(view_.z, kLeastCosine);
  layer(material, inside, limits);
  chances_.diffuse = largest(diffuse_), chances_.translucent = largest(translucent_);
  chances_.glossy = largest(glossy_albedo_), chances_.refracted = largest(refracted_albedo_);
  total_ = chances_.diffuse + chances_.translucent + chances_.glossy + chances_.refracted;
}

void Bsdf::layer(const Material& material, bool inside, const Limits& limits) noexcept {
  const float clear = material.surface * (1.0f - material.metallic) * material.transmission;
  float below =
      material.surface * (1.0f - material.metallic) * (1.0f - material.transmission) * (1.0f - material.translucency);
  if (material.metallic > 0.0f && !limits.no_reflection) add_metal(material);
  if (material.reflectance > 0.0f && below > 0.0f && !limits.no_reflection) below = add_dielectric(material, below);
  if (clear > 0.0f) add_glass(material, clear, inside, limits);
  diffuse_ = material.color * below, translucent_ = material.translucent * material.surface;
}

void Bsdf::add_metal(const Material& material) noexcept {
  const FacetShare mirrors = share_of_mirrors(view_.z, roughness_);
  const float all = material.metallic * material.surface, even = all * material.even_metal, rest = all - even;
  metal_ = MetalFresnel(min(material.metal, kWhite), min(material.specular_tint, kWhite));
  metal_share_ = with_what_bounces(metal_.mean(), mirrors, kept_) * rest;
  even_ = material.metal * with_what_bounces(min(material.metal, kWhite), mirrors, kept_) * even;
  const Vec3f risen = metal_.risen(FacetAlbedo::tables().metal_rise(view_.z, roughness_));
  glossy_albedo_ = (risen * metal_share_ + even_) * mirrors.here;
}

float Bsdf::add_dielectric(const Material& material, float share) noexcept {
  const FacetAlbedo& tables = FacetAlbedo::tables();
  const FacetShare mirrors = share_of_mirrors(view_.z, roughness_);
  dielectric_ = DielectricFresnel(ior_of(material.reflectance), material.specular_tint);
  const Vec3f mean = dielectric_.risen(dielectric_.rise(mean_fresnel(dielectric_.ior())));
  const Vec3f gain = with_what_bounces(mean, mirrors, kept_);
  const Vec3f risen = dielectric_.risen(tables.dielectric_rise(view_.z, roughness_, dielectric_.ior()));
  const Vec3f albedo = risen * gain * mirrors.here;
  dielectric_share_ = gain * share, glossy_albedo_ = glossy_albedo_ + albedo * share;
  // As in Cycles, light that is lost between facets does not reach the base.
  return share * (1.0f - largest(albedo + risen * ((1.0f - kept_) * (1.0f - mirrors.here))));
}

void Bsdf::add_glass(const Material& material, float share, bool inside, const Limits& limits) noexcept {
  glass_ = DielectricFresnel(inside ? 1.0f / material.ior : material.ior, material.specular_tint);
  const float plain = share * material.plain_refraction;
  // Most of its colour is that of what it lets through.
  const FacetShare panes = share_of_panes(view_.z, roughness_, glass_.ior());
  const Vec3f gain = with_what_bounces(min(material.tint, kWhite), panes, kept_);
  const Vec3f rest = gain * (share - plain);
  // Some facets of rough glass let light through wherever they are seen from.
  constexpr float kMost = 0.75f;
  const Vec3f reflected = is_smooth() ? glass_(view_.z) : min(glass_(view_.z), Vec3f{kMost, kMost, kMost});
  if (!limits.no_reflection) {
    const Vec3f tint = kWhite + (material.tint - kWhite) * material.tinted_glass;
    glass_reflection_ = tint * rest;
    glossy_albedo_ = glossy_albedo_ + glass_reflection_ * reflected;
  }
  if (limits.no_refraction) return;
  glass_refraction_ = material.tint * rest, plain_refraction_ = material.tint * plain;
  refracted_albedo_ = glass_refraction_ * (kWhite - reflected);
  if (!is_smooth() || fresnel(view_.z, glass_.ior()).reflected < 1.0f) {
    refracted_albedo_ = refracted_albedo_ + plain_refraction_;
  }
}

Vec3f Bsdf::reflected(float cosine) const noexcept {
  Vec3f share = even_;
  if (largest(metal_share_) > 0.0f) share = share + metal_(cosine) * metal_share_;
  if (largest(dielectric_share_) > 0.0f) share = share + dielectric_(cosine) * dielectric_share_;
  if (largest(glass_reflection_) > 0.0f) share = share + glass_(cosine) * glass_reflection_;
  return share;
}

float Bsdf::unshadowed(Vec3f out, float height) const noexcept {
  if (!is_bent_) return 1.0f;
  const float share = dot(out, mesh_normal_) / (height * dot(normal_, mesh_normal_));
  if (!(share > 0.0f)) return 0.0f;
  return share < 1.0f ? share * (1.0f + share * (1.0f - share)) : 1.0f;
}

// Where not all is reflected.
Vec3f Bsdf::passed(float cosine) const noexcept {
  return glass_refraction_ * (kWhite - glass_(cosine)) + plain_refraction_;
}

void Bsdf::evaluate_reflected(Vec3f out, float height, Value& value) const noexcept {
  value.share = value.share + diffuse_ * unshadowed(out, height);
  value.density += chances_.diffuse / total_ * height / kPi;
  if (!(chances_.glossy > 0.0f) || is_smooth() || !(out.z > 0.0f)) return;
  const Facets facets(alpha_);
  const Vec3f half = normalized(view_ + out);
  const float slant = dot(view_, half);
  if (!(slant > 0.0f)) return;
  const float density = facets.seen_density(view_, half) / (4.0f * slant);
  value.share = value.share + reflected(slant) * (kPi * density * facets.lit_of_seen(view_.z, out.z) / height);
  value.density += chances_.glossy / total_ * density;
}

void Bsdf::evaluate_refracted(Vec3f out, float height, Value& value) const noexcept {
  const float depth = std::max(-height, kLeastCosine);
  value.share = value.share + translucent_ * unshadowed(out, height);
  value.density += chances_.translucent / total_ * depth / kPi;
  if (!(chances_.refracted > 0.0f) || is_smooth() || glass_.ior() == 1.0f || out.z > 0.0f) return;
  Vec3f half = normalized(view_ + out * glass_.ior());
  if (half.z < 0.0f) half = -half;
  const float slant = dot(view_, half), beyond = dot(out, half);
  if (!(slant > 0.0f) || !(beyond < 0.0f)) return;
  const Facets facets(alpha_);
  const float sum = slant + glass_.ior() * beyond;
  const float density =
      facets.seen_density(view_, half) * glass_.ior() * glass_.ior() * -beyond / std::max(sum * sum, 1e-12f);
  const float down = std::max(-out.z, kLeastCosine);
  value.share = value.share + passed(slant) * (kPi * density * facets.lit_of_seen(view_.z, down) / depth);
  value.density += chances_.refracted / total_ * density;
}

Bsdf::Value Bsdf::evaluate_local(Vec3f out) const noexcept {
  Value value;
  const float height = dot(out, normal_);
  if (height > 0.0f) {
    evaluate_reflected(out, height, value);
  } else if (transmits()) {
    evaluate_refracted(out, height, value);
  }
  return value;
}

void Bsdf::add_hair(const HairBsdf& hair) noexcept {
  hair_ = hair;
  chances_.hair = largest(hair.albedo());
  total_ += chances_.hair;
}

Bsdf::Value Bsdf::evaluate_strand(Vec3f direction, Value surface, HairBsdf::Value hair) const noexcept {
  const float slant = std::abs(dot(local(direction), normal_));
  return {surface.share * slant + hair.share * kPi, surface.density + hair.density * (chances_.hair / total_)};
}

Bsdf::Value Bsdf::evaluate(Vec3f direction) const noexcept {
  if (!hair_) return evaluate_local(local(direction));
  const bool has_surface = total_ > chances_.hair;
  return evaluate_strand(direction, has_surface ? evaluate_local(local(direction)) : Value{},
                         hair_->evaluate(direction));
}

Bsdf::Value Bsdf::evaluate_diffuse(Vec3f direction) const noexcept {
  const Vec3f out = local(direction);
  const float height = dot(out, normal_), slant = std::abs(height) / kPi;
  const Vec3f share = (height > 0.0f ? diffuse_ : translucent_) * unshadowed(out, height);
  const float chance = height > 0.0f ? chances_.diffuse : chances_.translucent;
  const Value value{share, chance > 0.0f ? chance / total_ * slant : 0.0f};
  return hair_ ? evaluate_strand(direction, value, {}) : value;
}

// In the frame; the weight is that of a smooth surface.
Bsdf::Sample Bsdf::sample_facet(Point2 random, bool refract) const noexcept {
  const Vec3f facet = is_smooth() ? Vec3f{0, 0, 1} : Facets(alpha_).choose_seen(view_, random);
  const float slant = dot(view_, facet);
  if (!(slant > 0.0f)) return {};
  Sample sample;
  if (!refract) {
    sample = {Scatter::kGlossy, facet * (2.0f * slant) - view_, reflected(slant), 0.0f};
    return sample.direction.z > 0.0f ? sample : Sample{};
  }
  const Fresnel boundary = fresnel(slant, glass_.ior());
  const float shrink = 1.0f / glass_.ior();
  const Vec3f out = facet * (shrink * slant - boundary.cosine) - view_ * shrink;
  if (!(boundary.reflected < 1.0f) || !(out.z < 0.0f)) return {};
  return {Scatter::kRefracted, normalized(out), passed(slant), 0.0f};
}

Bsdf::Sample Bsdf::sample(float pick, Point2 random) const noexcept {
  if (is_black()) return {};
  const float left = pick * total_, others = total_ - chances_.hair;
  return left < others || !hair_ ? sample_surface(left, random)
                                 : sample_strand((left - others) / chances_.hair, random);
}

Bsdf::Sample Bsdf::sample_strand(float pick, Point2 random) const noexcept {
  const HairBsdf::Sample chosen = hair_->sample(pick, random);
  const Value value = evaluate(chosen.direction);
  if (!(value.density > 0.0f)) return {};
  return {chosen.passes ? Scatter::kRefracted : Scatter::kGlossy, chosen.direction,
          value.share * (1.0f / (kPi * value.density)), value.density, true};
}

// left: of the sum of the chances but that of hair.
Bsdf::Sample Bsdf::sample_surface(float left, Point2 random) const noexcept {
  Sample sample;
  float chance = 0.0f;
  const auto takes = [&](float part) {
    if (left < part) return true;
    left -= part;
    return false;
  };
  if (takes(chances_.diffuse)) {
    sample.kind = Scatter::kDiffuse, sample.direction = cosine_direction(normal_, random);
  } else if (takes(chances_.translucent)) {
    sample.kind = Scatter::kTranslucent, sample.direction = -cosine_direction(normal_, random);
  } else {
    const bool refract = !takes(chances_.glossy);
    chance = (refract ? chances_.refracted : chances_.glossy) / total_;
    if (!(chance > 0.0f)) return {};
    sample = sample_facet(random, refract);
    if (sample.kind == Scatter::kNone) return sample;
  }
  const Vec3f out = sample.direction;
  const float height = dot(out, normal_);
  const bool goes_beyond = sample.kind == Scatter::kTranslucent || sample.kind == Scatter::kRefracted;
  if (goes_beyond ? height > 0.0f : !(height > 0.0f)) return {};
  sample.direction = frame_.world(out);
  const bool is_facet = sample.kind == Scatter::kGlossy || sample.kind == Scatter::kRefracted;
  if (is_facet && (is_smooth() || (sample.kind == Scatter::kRefracted && glass_.ior() == 1.0f))) {
    sample.weight = sample.weight * (1.0f / chance);
    sample.density = std::numeric_limits<float>::infinity();
    return sample;
  }
  Value value = evaluate_local(out);
  if (hair_) value = evaluate_strand(sample.direction, value, hair_->evaluate(sample.direction));
  if (!(value.density > 0.0f)) return {};
  const float slant = hair_ ? 1.0f : std::abs(height);
  sample.weight = value.share * (slant / (kPi * value.density)), sample.density = value.density;
  return sample;
}

Bsdf::Albedo Bsdf::albedo() const noexcept {
  Albedo albedo;
  albedo.plain = diffuse_ + translucent_, albedo.plain_share = chances_.diffuse + chances_.translucent;
  const Vec3f facets = glossy_albedo_ + refracted_albedo_;
  const float share = chances_.glossy + chances_.refracted;
  if (roughness_ > kSharpest) {
    albedo.plain = albedo.plain + facets, albedo.plain_share += share;
  } else {
    albedo.mirrored = facets, albedo.mirrored_share = share;
  }
  if (hair_) albedo.plain = albedo.plain + hair_->albedo(), albedo.plain_share += chances_.hair;
  return albedo;
}

}  // namespace perfect_bvh
