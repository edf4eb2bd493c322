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
constexpr float kSharpest = 0.075f;  // roughness up to which a denoiser's guides look through, as in Cycles

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

bool is_stretched(const Material& material) noexcept { return material.finish && material.finish->stretch != 1.0f; }

Frame frame_of(const Material& material, Vec3f normal) noexcept {
  return is_stretched(material) ? framed(normal, material.tangent, material.finish->rotation) : Frame(normal);
}

Facets facets_of(const Material& material, float least_alpha) noexcept {
  const float alpha = material.roughness * material.roughness;
  if (!material.finish) return Facets(std::max(alpha, least_alpha));
  const Finish& finish = *material.finish;
  const auto width = [=](float wide) { return std::max(std::min(wide, 1.0f), least_alpha); };
  const auto kind = static_cast<FacetKind>(finish.distribution);
  return {width(alpha * finish.stretch), width(alpha / finish.stretch), kind};
}

}  // namespace

RoughDiffuse::RoughDiffuse(float roughness, Vec3f color, float view_cosine) noexcept
    : even_(1.0f / (1.0f + roughness * (0.5f - 2.0f / (3.0f * kPi)))),
      slope_(roughness * even_),
      view_cosine_(std::max(view_cosine, 0.0f)) {
  const float mean = even_ + slope_ * (2.0f / 3.0f - 28.0f / (15.0f * kPi)), lost = 1.0f - mean;
  const auto bounced = [&](float channel) {
    const float albedo = std::min(channel, 1.0f);
    return albedo * albedo * mean / (lost * (1.0f - albedo * lost)) * (1.0f - this->albedo(view_cosine_));
  };
  bounced_ = {bounced(color.x), bounced(color.y), bounced(color.z)};
}

float RoughDiffuse::albedo(float cosine) const noexcept {
  const float sine = std::sqrt(std::max(1.0f - cosine * cosine, 0.0f));
  const auto angle = static_cast<float>(arc_tangent(static_cast<double>(sine), static_cast<double>(cosine)));
  const float tangent = sine / std::max(cosine, 1e-6f);
  const float grazing = 2.0f / 3.0f * tangent * (1.0f - sine * sine * sine);
  return even_ + slope_ / kPi * (sine * (angle - 2.0f / 3.0f - sine * cosine) + grazing);
}

Vec3f RoughDiffuse::operator()(float light_cosine, float between) const noexcept {
  const float flat = between - light_cosine * view_cosine_;
  const float aside = flat > 0.0f ? flat / std::max(light_cosine, view_cosine_) : flat;
  const float once = even_ + slope_ * aside;
  return Vec3f{once, once, once} + bounced_ * (1.0f - albedo(light_cosine));
}

Bsdf::Bsdf(const Material& material, Vec3f normal, Vec3f geometric_normal, Vec3f view, bool inside,
           const Limits& limits) noexcept
    : frame_(frame_of(material, bent_normal(normal, geometric_normal, view))),
      normal_(local(normal)),
      view_(local(view)),
      facets_(facets_of(material, limits.least_alpha)),
      roughness_(material.roughness),
      kept_(1.0f - material.lossy_facets) {
  view_.z = std::max(view_.z, kLeastCosine);
  layer(material, inside, limits);
  if (material.finish) add_finish(material, {normal, geometric_normal, view}, limits);
  chances_.diffuse = largest(diffuse_), chances_.translucent = largest(translucent_);
  chances_.glossy = largest(glossy_albedo_), chances_.refracted = largest(refracted_albedo_);
  total_ =
      chances_.diffuse + chances_.translucent + chances_.glossy + chances_.refracted + chances_.sheen + chances_.coat;
}

void Bsdf::add_finish(const Material& material, const Coating::Place& place, const Limits& limits) noexcept {
  const Finish& finish = *material.finish;
  if (finish.diffuse_roughness > 0.0f) {
    rough_ = RoughDiffuse(finish.diffuse_roughness, material.color, dot(view_, normal_));
  }
  if (!(largest(finish.sheen) > 0.0f || finish.coat > 0.0f)) return;
  coating_.emplace(material, finish, place, limits.least_alpha, !limits.no_reflection);
  chances_.sheen = largest(coating_->sheen_albedo()), chances_.coat = largest(coating_->coat_albedo());
  const Vec3f below = coating_->below();
  for (Vec3f* const share : {&metal_share_, &even_, &dielectric_share_, &glass_reflection_, &glass_refraction_,
                             &plain_refraction_, &diffuse_, &translucent_, &glossy_albedo_, &refracted_albedo_}) {
    *share = *share * below;
  }
}

Vec3f Bsdf::diffuse(Vec3f out, float height) const noexcept {
  return rough_.is_even() ? diffuse_ : diffuse_ * rough_(height, dot(out, view_));
}

void Bsdf::evaluate_coating(Vec3f out, float height, Value& value) const noexcept {
  const Vec3f direction = frame_.world(out);
  const Coating::Value sheen = coating_->sheen(direction), coat = coating_->coat(direction);
  value.share =
      value.share + (sheen.light * seen_of(out, normal_) + coat.light) * (kPi / std::max(height, kLeastCosine));
  value.density += (chances_.sheen * sheen.density + chances_.coat * coat.density) / total_;
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
  // As in Cycles, the base does not get the light that is lost between facets.
  return share * (1.0f - largest(albedo + risen * ((1.0f - kept_) * (1.0f - mirrors.here))));
}

void Bsdf::add_glass(const Material& material, float share, bool inside, const Limits& limits) noexcept {
  glass_ = DielectricFresnel(inside ? 1.0f / material.ior : material.ior, material.specular_tint);
  const float plain = share * material.plain_refraction;
  // Its colour is mostly that of the transmitted light.
  const FacetShare panes = share_of_panes(view_.z, roughness_, glass_.ior());
  const Vec3f gain = with_what_bounces(min(material.tint, kWhite), panes, kept_);
  const Vec3f rest = gain * (share - plain);
  // Some facets of rough glass transmit light at any viewing angle.
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

float Bsdf::seen_of_bent(Vec3f out, Vec3f normal) const noexcept {
  const auto slope = [](float cosine) { return 1.0f / std::max(cosine * cosine, 1e-12f) - 1.0f; };
  const float alpha = std::clamp(0.125f * slope(dot(normal, mesh_normal_)), 0.0f, 1.0f);  // squared
  return 2.0f / (1.0f + std::sqrt(1.0f + alpha * std::max(slope(dot(out, mesh_normal_)), 0.0f)));
}

// Used if not all light is reflected.
Vec3f Bsdf::passed(float cosine) const noexcept {
  return glass_refraction_ * (kWhite - glass_(cosine)) + plain_refraction_;
}

void Bsdf::evaluate_plain(Vec3f out, float height, Value& value) const noexcept {
  evaluate_translucent(out, height, value);
  if (!(height > 0.0f) || leaks(out, normal_)) return;
  value.share = value.share + diffuse(out, height) * seen_of(out, normal_);
  value.density += chances_.diffuse / total_ * std::max(height, kLeastCosine) / kPi;
  if (coating_) evaluate_coating(out, height, value);
}

// Cycles bends the normal of translucent light like that of facets.
void Bsdf::evaluate_translucent(Vec3f out, float height, Value& value) const noexcept {
  if (!(chances_.translucent > 0.0f) || !(out.z < 0.0f) || leaks(out, {0, 0, 1})) return;
  const float slant = std::max(std::abs(height), kLeastCosine), depth = std::max(-out.z, kLeastCosine);
  value.share = value.share + translucent_ * (seen_of(out, {0, 0, 1}) * depth / slant);
  value.density += chances_.translucent / total_ * depth / kPi;
}

void Bsdf::evaluate_reflected(Vec3f out, float slant, Value& value) const noexcept {
  if (!(chances_.glossy > 0.0f)) return;
  const Vec3f half = normalized(view_ + out);
  const float off = dot(view_, half);
  if (!(off > 0.0f)) return;
  const float density = facets_.seen_density(view_, half) / (4.0f * off);
  value.share = value.share + reflected(off) * (kPi * density * facets_.lit_of_seen(view_, out, half) / slant);
  value.density += chances_.glossy / total_ * density;
}

void Bsdf::evaluate_refracted(Vec3f out, float slant, Value& value) const noexcept {
  if (!(chances_.refracted > 0.0f) || glass_.ior() == 1.0f) return;
  Vec3f half = normalized(view_ + out * glass_.ior());
  if (half.z < 0.0f) half = -half;
  const float off = dot(view_, half), beyond = dot(out, half);
  if (!(off > 0.0f) || !(beyond < 0.0f)) return;
  const float sum = off + glass_.ior() * beyond;
  const float density =
      facets_.seen_density(view_, half) * glass_.ior() * glass_.ior() * -beyond / std::max(sum * sum, 1e-12f);
  value.share = value.share + passed(off) * (kPi * density * facets_.lit_of_seen(view_, out, half) / slant);
  value.density += chances_.refracted / total_ * density;
}

Bsdf::Value Bsdf::evaluate_local(Vec3f out) const noexcept {
  Value value;
  const float height = dot(out, normal_);
  evaluate_plain(out, height, value);
  if (!has_facets() || is_smooth() || leaks(out, {0, 0, 1})) return value;
  const float slant = std::max(std::abs(height), kLeastCosine);
  if (out.z > 0.0f) {
    evaluate_reflected(out, slant, value);
  } else {
    evaluate_refracted(out, slant, value);
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
  const float height = dot(out, normal_);
  Value value;
  evaluate_translucent(out, height, value);
  if (height > 0.0f && !leaks(out, normal_)) {
    value.share = value.share + diffuse(out, height) * seen_of(out, normal_);
    const float slant = std::max(height, kLeastCosine);
    if (chances_.diffuse > 0.0f) value.density += chances_.diffuse / total_ * (slant / kPi);
    if (coating_) {
      const Coating::Value sheen = coating_->sheen(direction);
      value.share = value.share + sheen.light * (seen_of(out, normal_) * kPi / slant);
      value.density += chances_.sheen * sheen.density / total_;
    }
  }
  return hair_ ? evaluate_strand(direction, value, {}) : value;
}

// Directions are in the frame; the weight is that of a smooth surface.
Bsdf::Sample Bsdf::sample_facet(Point2 random, bool refract) const noexcept {
  const Vec3f facet = is_smooth() ? Vec3f{0, 0, 1} : facets_.choose_seen(view_, random);
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

// left: the part of the sum of all chances except that of hair.
Bsdf::Sample Bsdf::sample_surface(float left, Point2 random) const noexcept {
  Sample sample;
  float chance = 0.0f;
  bool is_coat = false, is_smooth_coat = false;
  const auto takes = [&](float part) {
    if (left < part) return true;
    left -= part;
    return false;
  };
  if (takes(chances_.diffuse)) {
    sample.kind = Scatter::kDiffuse, sample.direction = cosine_direction(normal_, random);
  } else if (takes(chances_.translucent)) {
    sample.kind = Scatter::kTranslucent, sample.direction = -cosine_direction({0, 0, 1}, random);
  } else if (coating_ && takes(chances_.sheen)) {
    sample.kind = Scatter::kDiffuse, sample.direction = local(coating_->choose_sheen(random));
  } else if (coating_ && takes(chances_.coat)) {
    const Coating::Mirrored mirrored = coating_->choose_coat(random);
    sample.kind = Scatter::kGlossy, sample.direction = local(mirrored.direction), sample.weight = mirrored.weight;
    chance = chances_.coat / total_, is_smooth_coat = coating_->has_smooth_coat(), is_coat = true;
  } else {
    const bool refract = !takes(chances_.glossy);
    chance = (refract ? chances_.refracted : chances_.glossy) / total_;
    if (!(chance > 0.0f)) return {};
    sample = sample_facet(random, refract);
    if (sample.kind == Scatter::kNone) return sample;
  }
  const Vec3f out = sample.direction;
  const float height = dot(out, normal_);
  const bool is_facet = sample.kind == Scatter::kGlossy || sample.kind == Scatter::kRefracted;
  if ((is_coat || sample.kind == Scatter::kDiffuse) && !(height > 0.0f)) return {};  // a facet's own normal says
  sample.direction = frame_.world(out);
  const bool is_single =
      is_coat ? is_smooth_coat : is_smooth() || (sample.kind == Scatter::kRefracted && glass_.ior() == 1.0f);
  if (is_facet && is_single) {
    sample.weight = sample.weight * (1.0f / chance);
    sample.density = std::numeric_limits<float>::infinity();
    return sample;
  }
  Value value = evaluate_local(out);
  if (hair_) value = evaluate_strand(sample.direction, value, hair_->evaluate(sample.direction));
  if (!(value.density > 0.0f)) return {};
  const float slant = hair_ ? 1.0f : std::max(std::abs(height), kLeastCosine);
  sample.weight = value.share * (slant / (kPi * value.density)), sample.density = value.density;
  return sample;
}

Bsdf::Albedo Bsdf::albedo() const noexcept {
  Albedo albedo;
  albedo.plain = diffuse_ + translucent_, albedo.plain_share = chances_.diffuse + chances_.translucent;
  if (coating_) {
    albedo.plain = albedo.plain + coating_->sheen_albedo() + coating_->coat_albedo();
    albedo.plain_share += chances_.sheen + chances_.coat;
  }
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
