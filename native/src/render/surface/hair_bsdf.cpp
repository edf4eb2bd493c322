#include "render/surface/hair_bsdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "render/sampling/sampler.h"
#include "render/surface/microfacets.h"

namespace perfect_bvh {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLeast = 0.001, kLeastColor = 1e-5;

double square(double value) noexcept { return value * value; }
double cosine_from(double sine) noexcept { return std::sqrt(std::max(0.0, 1.0 - sine * sine)); }

double to_the(double value, int exponent) noexcept {
  double result = 1.0;
  for (; exponent > 0; exponent >>= 1, value *= value) {
    if ((exponent & 1) != 0) result *= value;
  }
  return result;
}

// The modified Bessel function I0 over e^x, x >= 0: the polynomials of Abramowitz and Stegun, 9.8.1 and 9.8.2.
double scaled_bessel(double x) noexcept {
  static constexpr std::array kNear{1.0, 3.5156229, 3.0899424, 1.2067492, 0.2659732, 0.0360768, 0.0045813};
  static constexpr std::array kFar{0.39894228,  0.01328592, 0.00225319,  -0.00157565, 0.00916281,
                                   -0.02057706, 0.02635537, -0.01647633, 0.00392377};
  constexpr double kBorder = 3.75;
  if (x < kBorder) return series::sum(kNear, square(x / kBorder)) * exponential(-x);
  return series::sum(kFar, kBorder / x) / std::sqrt(x);
}

// The distribution along the fiber: over the sine of one angle, given the other (d'Eon et al. 2011), in a form that
// does not overflow.
double spread_along(double sine, double cosine, const HairDirection& view, double variance, double whole) noexcept {
  const double a = cosine * view.cosine / variance, b = sine * view.sine / variance;
  return scaled_bessel(a) * exponential(a - b - 1.0 / variance) / whole;
}
double whole_along(double variance) noexcept { return variance * (1.0 - exponential(-2.0 / variance)); }

double logistic_below(double x, double scale) noexcept { return 1.0 / (1.0 + exponential(-x / scale)); }

// The distribution around the fiber, from -pi to pi.
double spread_around(double angle, double scale, double whole) noexcept {
  const double away = exponential(-std::abs(angle) / scale);
  return away / (scale * square(1.0 + away) * whole);
}
double choose_around(double random, double scale) noexcept {
  const double least = logistic_below(-kPi, scale);
  const double share = random * (1.0 - 2.0 * least) + least;
  return std::clamp(-scale * logarithm(1.0 / share - 1.0), -kPi, kPi);
}

double wrapped(double angle) noexcept { return angle - 2.0 * kPi * std::floor((angle + kPi) / (2.0 * kPi)); }

double variance_of(double roughness) noexcept {
  return square(0.726 * roughness + 0.812 * square(roughness) + 3.7 * to_the(roughness, 20));
}
double scale_of(double roughness) noexcept {
  constexpr double kRootOfPiOver8 = 0.62665706865775;
  return kRootOfPiOver8 * (0.265 * roughness + 1.194 * square(roughness) + 5.372 * to_the(roughness, 22));
}

double width_of(float roughness) noexcept { return std::clamp(static_cast<double>(roughness), kLeast, 1.0); }

double mean(Vec3f color) noexcept { return (static_cast<double>(color.x) + color.y + color.z) / 3.0; }

// Returns the direction across the strand towards the viewer; any perpendicular direction if the view is along it.
Vec3f across_strand(Vec3f along, Vec3f view) noexcept {
  const Vec3f flat = view - along * dot(view, along);
  return dot(flat, flat) > 1e-12f ? normalized(flat) : Frame(along).x;
}

// Returns the position across the strand that the viewer sees: -1 at one edge, 1 at the other.
double aside_of(const HairBsdf::Place& place, Vec3f y, Vec3f z) noexcept {
  const auto towards = static_cast<double>(dot(place.normal, y)), aside = static_cast<double>(dot(place.normal, z));
  const double size = std::sqrt(towards * towards + aside * aside);
  return size > 0.0 ? std::clamp(-aside / size, -1.0, 1.0) : 0.0;
}

Vec3f absorption_of(const Hair& hair, Vec3f color) noexcept {
  return hair.colored ? hair.absorption + absorption_of(color, hair.radial_roughness) : hair.absorption;
}

}  // namespace

Vec3f absorption_of(Vec3f color, float radial_roughness) noexcept {
  static constexpr std::array kFit{5.969, -0.215, 2.532, -10.73, 5.574, 0.245};
  const double divisor = series::sum(kFit, static_cast<double>(radial_roughness));
  const auto of = [divisor](float channel) {
    const double share = std::max(static_cast<double>(channel), kLeastColor);
    return static_cast<float>(square(logarithm(share) / divisor));
  };
  return {of(color.x), of(color.y), of(color.z)};
}

HairFiber::HairFiber(const Hair& hair, Vec3f absorption, const HairDirection& view, double aside, float least) noexcept
    : view_(view) {
  const auto ior = static_cast<double>(hair.ior);
  const double inside = cosine_from(view_.sine / ior);
  // Viewed along the fiber, it refracts more strongly (Bravais).
  const double bravais = view_.cosine / std::sqrt(std::max(ior * ior - view_.sine * view_.sine, 1e-12));
  const double aside_inside = std::clamp(aside * bravais, -1.0, 1.0);
  const double way = 2.0 * cosine_from(aside_inside) / std::max(inside, 1e-6);
  const auto left = [way](float channel) {
    return static_cast<float>(exponential(-static_cast<double>(channel) * way));
  };
  const float reflected = fresnel(static_cast<float>(view_.cosine * cosine_from(aside)), hair.ior).reflected;
  set_widths(hair, least);
  set_tilts(hair);
  set_middles(aside, aside_inside);
  set_shares(hair, {left(absorption.x), left(absorption.y), left(absorption.z)}, static_cast<double>(reflected));
}

void HairFiber::set_widths(const Hair& hair, float least) noexcept {
  const double roughness = width_of(hair.roughness), radial = width_of(hair.radial_roughness);
  const double first = std::clamp(roughness * (1.0 - static_cast<double>(hair.coat)), kLeast, 1.0);
  const auto widest = static_cast<double>(least);
  const double variance = std::max(variance_of(roughness), widest), scale = std::max(scale_of(radial), widest);
  lobes_[0].variance = std::max(variance_of(first), widest);
  lobes_[1].variance = 0.25 * variance;
  lobes_[2].variance = lobes_[3].variance = 4.0 * variance;
  const double whole = 1.0 - 2.0 * logistic_below(-kPi, scale);
  for (std::size_t i = 0; i < lobes_.size(); ++i) {
    Lobe& lobe = lobes_[i];
    lobe.scale = scale, lobe.whole_around = whole;
    lobe.whole_along = i == 3 ? lobes_[2].whole_along : whole_along(lobe.variance);
  }
  lobes_[3].scale = 0.0;
}

// The scales of the cuticle rotate the lobes by twice, once and four times their tilt.
void HairFiber::set_tilts(const Hair& hair) noexcept {
  constexpr std::array kTurns{2.0, -1.0, -4.0, 0.0};
  for (std::size_t i = 0; i < kTurns.size(); ++i) {
    const auto [sine, cosine] = sine_cosine(kTurns[i] * static_cast<double>(hair.tilt));
    lobes_[i].sine_of_tilt = sine, lobes_[i].cosine_of_tilt = cosine;
  }
}

void HairFiber::set_middles(double aside, double aside_inside) noexcept {
  const double outer = arc_sine(aside), inner = arc_sine(aside_inside);
  for (std::size_t i = 0; i < lobes_.size(); ++i) {
    lobes_[i].middle = 2.0 * static_cast<double>(i) * inner - 2.0 * outer + static_cast<double>(i) * kPi;
  }
}

// passed: the transmittance of a path through the fiber. reflected: the reflectance of the wall, from either side.
void HairFiber::set_shares(const Hair& hair, Vec3f passed, double reflected) noexcept {
  const Vec3f white{1, 1, 1};
  const Vec3f inside = passed * static_cast<float>(1.0 - reflected);
  const Vec3f again = inside * passed * static_cast<float>(reflected);
  // The series of repeated internal reflections.
  const auto rest = [&](float channel) {
    const double left = static_cast<double>(channel) * reflected;
    return static_cast<float>(left * (1.0 - reflected) / std::max(1.0 - left, 1e-6));
  };
  shares_[0] = white * static_cast<float>(reflected);
  shares_[1] = inside * static_cast<float>(1.0 - reflected);
  shares_[2] = again * static_cast<float>(1.0 - reflected);
  shares_[3] = again * Vec3f{rest(passed.x), rest(passed.y), rest(passed.z)};
  double sum = 0.0;
  for (std::size_t i = 0; i < shares_.size(); ++i) {
    shares_[i] = shares_[i] * hair.fiber;
    lobes_[i].chance = mean(shares_[i]), sum += lobes_[i].chance;
  }
  if (!(sum > 0.0)) return;
  for (Lobe& lobe : lobes_) lobe.chance /= sum;
}

double HairFiber::density_of(const Lobe& lobe, const HairDirection& direction) const noexcept {
  const double sine = direction.sine * lobe.cosine_of_tilt + direction.cosine * lobe.sine_of_tilt;
  const double cosine = std::abs(direction.cosine * lobe.cosine_of_tilt - direction.sine * lobe.sine_of_tilt);
  const double along = spread_along(sine, cosine, view_, lobe.variance, lobe.whole_along);
  if (lobe.scale == 0.0) return along / (2.0 * kPi);
  return along * spread_around(wrapped(direction.around - lobe.middle), lobe.scale, lobe.whole_around);
}

HairValue HairFiber::evaluate(const HairDirection& direction) const noexcept {
  HairValue value;
  for (std::size_t i = 0; i < lobes_.size(); ++i) {
    if (!(lobes_[i].chance > 0.0)) continue;
    const double density = density_of(lobes_[i], direction);
    value.share = value.share + shares_[i] * static_cast<float>(density);
    value.density += lobes_[i].chance * density;
  }
  return value;
}

HairFiber::Sample HairFiber::sample(double pick, Point2 random) const noexcept {
  int number = 0;
  for (; number + 1 < kLobes && pick >= lobes_[static_cast<std::size_t>(number)].chance; ++number) {
    pick -= lobes_[static_cast<std::size_t>(number)].chance;
  }
  const Lobe& lobe = lobes_[static_cast<std::size_t>(number)];
  const double turn = std::clamp(pick / lobe.chance, 0.0, 1.0), height = std::max(static_cast<double>(random.x), 1e-9);
  // A point of the sphere about the mirrored view (d'Eon 2013).
  const double away = exponential(-2.0 / lobe.variance);
  const double near = 1.0 + lobe.variance * logarithm(height + (1.0 - height) * away);
  const double flat = -near * view_.sine + cosine_from(near) * cosine(2.0 * kPi * turn) * view_.cosine;
  const double across = cosine_from(flat);
  const double tilted = flat * lobe.cosine_of_tilt - across * lobe.sine_of_tilt;
  const auto side = static_cast<double>(random.y);
  const double around =
      lobe.scale == 0.0 ? 2.0 * kPi * side - kPi : wrapped(lobe.middle + choose_around(side, lobe.scale));
  return {{tilted, cosine_from(tilted), around}, number};
}

HairBsdf::HairBsdf(const Hair& hair, Vec3f color, const Place& place, float least) noexcept
    : x_(place.along),
      y_(across_strand(place.along, place.view)),
      z_(cross(x_, y_)),
      fiber_(hair, absorption_of(hair, color), local(place.view), aside_of(place, y_, z_), least) {}

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

HairBsdf::Value HairBsdf::evaluate(Vec3f direction) const noexcept {
  const HairValue value = fiber_.evaluate(local(direction));
  return {value.share, static_cast<float>(value.density)};
}

HairBsdf::Sample HairBsdf::sample(float pick, Point2 random) const noexcept {
  const HairFiber::Sample chosen = fiber_.sample(static_cast<double>(pick), random);
  return {world(chosen.direction), chosen.lobe > 0};
}

}  // namespace perfect_bvh
