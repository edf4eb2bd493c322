#include "render/surface/hair_bsdf.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/elementary.h"
#include "render/sampling/directions.h"

namespace perfect_bvh {
namespace {

double mean(Vec3f color) noexcept { return (static_cast<double>(color.x) + color.y + color.z) / 3.0; }

// Across the strand, towards the viewer; any such direction where one looks along it.
Vec3f across(Vec3f along, Vec3f view) noexcept {
  const Vec3f flat = view - along * dot(view, along);
  return dot(flat, flat) > 1e-12f ? normalized(flat) : Frame(along).x;
}

// Where the viewer looks across the strand: -1 one edge, 1 the other.
double aside_of(const HairBsdf::Place& place, Vec3f y, Vec3f z) noexcept {
  const auto towards = static_cast<double>(dot(place.normal, y)), aside = static_cast<double>(dot(place.normal, z));
  const double size = std::sqrt(towards * towards + aside * aside);
  return size > 0.0 ? std::clamp(-aside / size, -1.0, 1.0) : 0.0;
}

Vec3f absorption_of(const Hair& hair, Vec3f color) noexcept {
  return hair.colored ? hair.absorption + absorption_of(color, hair.radial_roughness) : hair.absorption;
}

}  // namespace

HairBsdf::HairBsdf(const Hair& hair, Vec3f color, const Place& place, float least) noexcept
    : normal_(place.normal),
      x_(place.along),
      y_(across(place.along, place.view)),
      z_(cross(x_, y_)),
      fiber_(hair, absorption_of(hair, color), local(place.view), aside_of(place, y_, z_), least),
      lobes_{StrandLobe(hair.reflection, false, local(place.view), least),
             StrandLobe(hair.transmission, true, local(place.view), least)},
      colors_{hair.reflection.color, hair.transmission.color},
      all_reflected_(hair.model == FiberModel::kHuang),
      // Cycles takes the density of all that Huang's model chooses to be 1.
      widening_(all_reflected_ && hair.fiber > 0.0f ? 1.0f : std::numeric_limits<float>::infinity()) {
  if (hair.colored) colors_ = {colors_[0] * color, colors_[1] * color};
  chances_ = {mean(fiber_.albedo()), mean(colors_[0]), mean(colors_[1])};
  const double sum = chances_[0] + chances_[1] + chances_[2];
  if (!(sum > 0.0)) return;
  for (double& chance : chances_) chance /= sum;
}

HairDirection HairBsdf::local(Vec3f world) const noexcept {
  const auto sine = std::clamp(static_cast<double>(dot(world, x_)), -1.0, 1.0);
  return {sine, std::sqrt(1.0 - sine * sine),
          arc_tangent(static_cast<double>(dot(world, z_)), static_cast<double>(dot(world, y_)))};
}

Vec3f HairBsdf::world(const HairDirection& direction) const noexcept {
  const auto [sine, cosine] = sine_cosine(direction.around);
  const auto x = static_cast<float>(direction.sine), y = static_cast<float>(direction.cosine * cosine),
             z = static_cast<float>(direction.cosine * sine);
  return normalized(x_ * x + y_ * y + z_ * z);
}

HairBsdf::Value HairBsdf::evaluate(Vec3f direction, bool is_lit) const noexcept {
  const HairDirection at = local(direction);
  const HairValue fiber = fiber_.evaluate(at);
  Vec3f share = fiber.share;
  double density = chances_[0] * fiber.density;
  const bool is_beyond = dot(direction, normal_) < 0.0f;
  for (std::size_t i = 0; i < lobes_.size(); ++i) {
    if (!(chances_[i + 1] > 0.0)) continue;
    const double chosen = lobes_[i].density(at);
    density += chances_[i + 1] * chosen;
    share = share + colors_[i] * static_cast<float>(is_lit ? lobes_[i].lit(at, is_beyond) : chosen);
  }
  return {share, static_cast<float>(density)};
}

HairBsdf::Value HairBsdf::evaluate(Vec3f direction) const noexcept { return evaluate(direction, false); }

HairBsdf::Value HairBsdf::lit(Vec3f direction) const noexcept { return evaluate(direction, true); }

HairBsdf::Sample HairBsdf::sample(float pick, Point2 random) const noexcept {
  auto left = static_cast<double>(pick);
  if (left < chances_[0]) {
    const HairFiber::Sample chosen = fiber_.sample(left / chances_[0], random);
    return {world(chosen.direction), chosen.lobe > 0 && !all_reflected_};
  }
  left -= chances_[0];
  const bool passes = left >= chances_[1];
  return {world(lobes_[passes ? 1 : 0].sample(random)), passes};
}

}  // namespace perfect_bvh
