#include "render/surface/hair_fiber.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "render/surface/fresnel.h"

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

// Along the fiber: over the sine of the one angle, given the other (d'Eon et al. 2011), in a form that does not
// overflow.
double spread_along(double sine, double cosine, const HairDirection& view, double variance) noexcept {
  const double a = cosine * view.cosine / variance, b = sine * view.sine / variance;
  const double narrow = variance * (1.0 - exponential(-2.0 / variance));
  return scaled_bessel(a) * exponential(a - b - 1.0 / variance) / narrow;
}

double logistic_below(double x, double scale) noexcept { return 1.0 / (1.0 + exponential(-x / scale)); }

// Around the fiber, from -pi to pi.
double spread_around(double angle, double scale) noexcept {
  const double away = exponential(-std::abs(angle) / scale);
  return away / (scale * square(1.0 + away) * (1.0 - 2.0 * logistic_below(-kPi, scale)));
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

// A roughness in Chiang's terms. Facets throw light less far than the widest of his lobes do.
double width_of(const Hair& hair, float roughness) noexcept {
  constexpr double kAlike = 0.3, kSlower = 0.12;
  const double given = std::clamp(static_cast<double>(roughness), kLeast, 1.0);
  if (hair.model == FiberModel::kChiang || given < kAlike) return given;
  return kAlike + (given - kAlike) * kSlower;
}

// What of light a fiber's wall reflects: from outside, from inside at first, and of what has been reflected there, at
// the next meeting and at those after it.
struct Walls {
  double outside, inside, caught, held;
};

// A number at a roughness, between those at 0, 0.2, ..., 1.
double between(const std::array<double, 6>& numbers, double roughness) noexcept {
  const double place = std::clamp(roughness, 0.0, 1.0) * 5.0;
  const auto low = static_cast<std::size_t>(std::min(place, 4.0));
  return numbers[low] + (numbers[low + 1] - numbers[low]) * (place - static_cast<double>(low));
}

// Facets of a rough wall reflect less from outside; from inside more, and what they have thrown along the wall once,
// they hold: little of it leaves before it is absorbed. Means over a fiber of index 1.55, as Cycles gives them for
// white hair.
Walls walls_of(const Hair& hair, double reflected) noexcept {
  if (hair.model == FiberModel::kChiang) return {reflected, reflected, reflected, reflected};
  static constexpr std::array kOutside{1.0, 0.82, 0.64, 0.51, 0.42, 0.34};
  static constexpr std::array kInside{0.05, 0.2, 0.245, 0.226, 0.199, 0.166};
  static constexpr std::array kLeaves{0.9, 0.267, 0.32, 0.394, 0.475, 0.54};
  constexpr double kHeld = 0.99999;
  const auto roughness = static_cast<double>(hair.roughness);
  const double inside = reflected + (1.0 - reflected) * between(kInside, roughness);
  return {reflected * between(kOutside, roughness), inside, 1.0 - between(kLeaves, roughness), kHeld};
}

double mean(Vec3f color) noexcept { return (static_cast<double>(color.x) + color.y + color.z) / 3.0; }

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
  // Seen along the fiber it refracts more strongly (Bravais).
  const double bravais = view_.cosine / std::sqrt(std::max(ior * ior - view_.sine * view_.sine, 1e-12));
  const double aside_inside = std::clamp(aside * bravais, -1.0, 1.0);
  const double way = 2.0 * cosine_from(aside_inside) / std::max(inside, 1e-6) * static_cast<double>(hair.way);
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
  const double roughness = width_of(hair, hair.roughness), radial = width_of(hair, hair.radial_roughness);
  const double first = std::clamp(roughness * (1.0 - static_cast<double>(hair.coat)), kLeast, 1.0);
  const auto widest = static_cast<double>(least);
  const double variance = std::max(variance_of(roughness), widest), scale = std::max(scale_of(radial), widest);
  lobes_[0].variance = std::max(variance_of(first), widest);
  lobes_[1].variance = 0.25 * variance;
  lobes_[2].variance = lobes_[3].variance = 4.0 * variance;
  for (Lobe& lobe : lobes_) lobe.scale = scale;
  lobes_[3].scale = 0.0;
}

// The scales of the cuticle turn the lobes by twice their tilt, by once, and by four times of it.
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

// passed: what is left of light on its way through; reflected: what a smooth wall reflects.
void HairFiber::set_shares(const Hair& hair, Vec3f passed, double reflected) noexcept {
  const Walls walls = walls_of(hair, reflected);
  const Vec3f white{1, 1, 1};
  const Vec3f inside = passed * static_cast<float>(1.0 - walls.outside);
  const Vec3f again = inside * passed * static_cast<float>(walls.inside);
  // The series of what is reflected inside again and again.
  const auto rest = [&](float channel) {
    const double left = static_cast<double>(channel) * walls.caught;
    const double out = left * (1.0 - walls.held) / std::max(1.0 - static_cast<double>(channel) * walls.held, 1e-6);
    return static_cast<float>(out);
  };
  shares_[0] = white * static_cast<float>(walls.outside);
  shares_[1] = inside * static_cast<float>(1.0 - walls.inside);
  shares_[2] = again * static_cast<float>(1.0 - walls.caught);
  shares_[3] = again * Vec3f{rest(passed.x), rest(passed.y), rest(passed.z)};
  const Vec3f lobes = hair.lobes * hair.fiber;
  const std::array factors{lobes.x, lobes.y, lobes.z, lobes.z};
  double sum = 0.0;
  for (std::size_t i = 0; i < shares_.size(); ++i) {
    shares_[i] = shares_[i] * factors[i];
    lobes_[i].chance = mean(shares_[i]), sum += lobes_[i].chance;
  }
  if (!(sum > 0.0)) return;
  for (Lobe& lobe : lobes_) lobe.chance /= sum;
}

double HairFiber::density_of(const Lobe& lobe, const HairDirection& direction) const noexcept {
  const double sine = direction.sine * lobe.cosine_of_tilt + direction.cosine * lobe.sine_of_tilt;
  const double cosine = std::abs(direction.cosine * lobe.cosine_of_tilt - direction.sine * lobe.sine_of_tilt);
  const double along = spread_along(sine, cosine, view_, lobe.variance);
  if (lobe.scale == 0.0) return along / (2.0 * kPi);
  return along * spread_around(wrapped(direction.around - lobe.middle), lobe.scale);
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

}  // namespace perfect_bvh
