// The chord of a line in a segment, compared with the segment's distance function in long double: min over s of |p -
// c(s)| - r(s), a different formula, which is convex along any line. The ends found must lie on the true surface, on
// both sides of the deepest point, and must be found if the line is inside by more than rounding.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "math/round_segment.h"

namespace perfect_bvh::test {
namespace {

using Real = long double;
constexpr Real kDoubleUlp = 0x1p-53L;

struct RealVec {
  Real x, y, z;
  friend RealVec operator+(RealVec a, RealVec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend RealVec operator-(RealVec a, RealVec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend RealVec operator*(RealVec a, Real s) { return {a.x * s, a.y * s, a.z * s}; }
};
Real dot(RealVec a, RealVec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
RealVec real(const double v[3]) { return {v[0], v[1], v[2]}; }

struct Segment {
  RoundBall first, last;
  [[nodiscard]] Real radius() const { return std::max(first.radius, last.radius); }
};

// Returns the distance of a point from the segment; negative inside.
Real distance(const Segment& segment, RealVec point) {
  const RealVec axis = real(segment.last.centre) - real(segment.first.centre);
  const RealVec from = point - real(segment.first.centre);
  const Real length = std::sqrt(dot(axis, axis)), widening = segment.last.radius - Real(segment.first.radius);
  Real s = widening > 0 ? 1 : 0;
  if (length > std::abs(widening)) {
    const Real along = dot(from, axis) / length;
    const RealVec across = from - axis * (along / length);
    const Real slope = widening / std::sqrt((length - widening) * (length + widening));
    s = std::clamp<Real>((along + std::sqrt(dot(across, across)) * slope) / length, 0, 1);
  }
  const RealVec away = from - axis * s;
  return std::sqrt(dot(away, away)) - (segment.first.radius + s * widening);
}

RealVec point_at(const RoundRay& ray, Real t) { return real(ray.origin) + real(ray.direction) * t; }

// Returns where the ray is deepest inside (or nearest): the distance is convex along it.
Real deepest(const Segment& segment, const RoundRay& ray) {
  const Real middle = Real(nearest_to_centre(ray, segment.first).t);
  const RealVec axis = real(segment.last.centre) - real(segment.first.centre);
  const Real reach = 2 * (std::sqrt(dot(axis, axis)) + segment.radius()) / std::sqrt(Real(ray.squared_length));
  Real low = middle - reach, high = middle + reach;
  for (int i = 0; i < 110; ++i) {
    const Real left = low + (high - low) / 3, right = high - (high - low) / 3;
    if (distance(segment, point_at(ray, left)) < distance(segment, point_at(ray, right))) {
      high = right;
    } else {
      low = left;
    }
  }
  return (low + high) / 2;
}

class RoundSegment : public testing::Test {
 protected:
  using Make = std::function<std::pair<Segment, RoundRay>()>;

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3d any_direction() {
    std::normal_distribution<double> normal;
    Vec3d v{normal(random_), normal(random_), normal(random_)};
    return normalized(v);
  }
  // Spheres in float, as meshes have them. Out of line: if GCC 12 vectorizes it with its callers, some of them use
  // numbers that were not narrowed.
  static __attribute__((noinline)) RoundBall ball(Vec3d centre, double radius) {
    return round_ball({to_float(centre), static_cast<float>(radius)}, 1.0f);
  }
  static Vec3d centre_of(const RoundBall& ball) { return {ball.centre[0], ball.centre[1], ball.centre[2]}; }
  static RoundRay ray_to(Vec3d origin, Vec3d target) {
    const Vec3d direction = target - origin;
    return round_ray(&origin.x, &direction.x);
  }
  static RoundRay ray_along(Vec3d origin, Vec3d direction) { return round_ray(&origin.x, &direction.x); }

  Segment any_segment(double first_radius, double last_radius) {
    const Vec3d from{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    return {ball(from, first_radius), ball(from + any_direction() * uniform(0.5, 2), last_radius)};
  }
  // A target in or near the segment, within `beyond` radii of its axis.
  Vec3d target_in(const Segment& segment, double beyond, double s) {
    const double radius = segment.first.radius + s * (segment.last.radius - segment.first.radius);
    return centre_of(segment.first) * (1 - s) + centre_of(segment.last) * s +
           any_direction() * (radius * uniform(0, beyond));
  }
  // Rays through the middle, past the ends and from inside.
  RoundRay any_ray(const Segment& segment, double away = 3.0, double beyond = 1.3) {
    const Vec3d target = target_in(segment, beyond, uniform(-0.1, 1.1));
    const Vec3d direction = any_direction();
    return ray_along(target - direction * uniform(0.0, away), direction * uniform(0.1, 10));
  }
  RoundRay aimed_ray(const Segment& segment, double away, double beyond = 1.3) {
    const Vec3d target = target_in(segment, beyond, uniform(-0.1, 1.1));
    return ray_to(target + any_direction() * away, target);
  }

  // `units`: the surface may be off by this many u (D + R); a tip's cone by another `tip` R.
  void expect_exact(const Make& make, double units = 16, double tip = 0, int count = 5000) {
    Real worst = 0, worst_in_radii = 0;
    int hits = 0;
    for (int i = 0; i < count; ++i) {
      const auto [segment, ray] = make();
      const Chord chord = chord_of_segment(ray, segment.first, segment.last);
      ASSERT_EQ(chord.entry, united(chord, chord_of_ball(ray, segment.first)).entry);
      ASSERT_EQ(chord.exit, united(chord, chord_of_ball(ray, segment.last)).exit);
      const RealVec to_first = real(segment.first.centre) - real(ray.origin);
      const RealVec axis = real(segment.last.centre) - real(segment.first.centre);
      const Real reach = std::sqrt(dot(to_first, to_first)) + std::sqrt(dot(axis, axis)) + segment.radius();
      const Real unit = kDoubleUlp * reach, slack = units * unit + tip * segment.radius();
      const Real middle = deepest(segment, ray), depth = distance(segment, point_at(ray, middle));
      if (!is_hit(chord)) {
        ASSERT_GT(depth, -slack) << "ray " << i << " was lost";
        continue;
      }
      ++hits;
      ASSERT_LT(depth, slack) << "ray " << i << " misses";
      for (const double t : {chord.entry, chord.exit}) {
        const Real off = std::abs(distance(segment, point_at(ray, t)));
        worst = std::max(worst, off / unit);
        worst_in_radii = std::max(worst_in_radii, off / segment.radius());
        ASSERT_LT(off, slack) << "ray " << i << " at " << t;
      }
      if (depth < -slack) {
        ASSERT_LE(chord.entry, static_cast<double>(middle)) << "ray " << i;
        ASSERT_GE(chord.exit, static_cast<double>(middle)) << "ray " << i;
        expect_normals(segment, ray, chord, slack);
      }
    }
    EXPECT_GT(hits, count / 20);
    EXPECT_LT(worst_in_radii, 1e-4);
    std::printf("%s: %d hits, off by %.2Lg u (D + R), %.2Lg R\n",
                testing::UnitTest::GetInstance()->current_test_info()->name(), hits, worst, worst_in_radii);
  }

  // A step outward along the normal must lead away from the segment by the same distance.
  static void expect_normals(const Segment& segment, const RoundRay& ray, const Chord& chord, Real slack) {
    for (const double t : {chord.entry, chord.exit}) {
      const RoundSurface surface = surface_at(ray, segment.first, segment.last, t);
      const RealVec normal = real(surface.normal), point = point_at(ray, t);
      if (dot(normal, normal) == 0) continue;  // a tip
      ASSERT_NEAR(static_cast<double>(dot(normal, normal)), 1.0, 1e-14);
      ASSERT_TRUE(surface.u >= 0 && surface.u <= 1);
      const Real step = segment.radius();
      ASSERT_NEAR(static_cast<double>(distance(segment, point + normal * step) / step), 1.0,
                  static_cast<double>(slack / step) + 1e-5);
      const RealVec axis = real(segment.last.centre) - real(segment.first.centre);
      const Real radius = segment.first.radius + surface.u * (Real(segment.last.radius) - segment.first.radius);
      const RealVec from = point - (real(segment.first.centre) + axis * surface.u);
      ASSERT_NEAR(static_cast<double>((std::sqrt(dot(from, from)) - radius) / step), 0.0,
                  static_cast<double>(slack / step) + 1e-12);
    }
  }

  std::mt19937_64 random_{5};
};

TEST_F(RoundSegment, OfAnyRadii) {
  expect_exact(
      [&] {
        const Segment segment = any_segment(uniform(0, 1), uniform(0, 1));
        return std::pair(segment, any_ray(segment));
      },
      16, 0x1p-24);
}

TEST_F(RoundSegment, OfEqualRadii) {
  expect_exact([&] {
    const double radius = std::pow(10.0, uniform(-4, 0));
    const Segment segment = any_segment(radius, radius);
    return std::pair(segment, aimed_ray(segment, uniform(0, 3)));
  });
}

TEST_F(RoundSegment, AMillionthAsThickAsLong) {
  expect_exact([&] {
    const Segment segment = any_segment(1e-6 * uniform(0.5, 1), 1e-6 * uniform(0.5, 1));
    return std::pair(segment, aimed_ray(segment, uniform(0, 3)));
  });
}

TEST_F(RoundSegment, FromAMillionAway) {
  expect_exact([&] {
    const Segment segment = any_segment(uniform(0.1, 1), uniform(0.1, 1));
    return std::pair(segment, aimed_ray(segment, 1e6));
  });
}

TEST_F(RoundSegment, AMillionthAsThickAsLongFromAThousandAway) {
  expect_exact([&] {
    const Segment segment = any_segment(1e-6 * uniform(0.5, 1), 1e-6 * uniform(0.5, 1));
    return std::pair(segment, aimed_ray(segment, 1e3));
  });
}

TEST_F(RoundSegment, WithATip) {
  expect_exact(
      [&] {
        const double radius = std::pow(10.0, uniform(-5, 0));
        Segment segment = any_segment(radius, 0);
        if (random_() % 2 == 0) std::swap(segment.first, segment.last);
        return std::pair(segment, any_ray(segment));
      },
      16, 1e-7);
}

// Rays at the tip itself, where the cone is thinner than rounding.
TEST_F(RoundSegment, NearATip) {
  expect_exact(
      [&] {
        const Segment segment = any_segment(uniform(0.01, 0.3), 0);
        const Vec3d target = centre_of(segment.last) + any_direction() * std::pow(10.0, uniform(-9, -2));
        return std::pair(segment, ray_to(target + any_direction() * uniform(0.1, 3), target));
      },
      16, 1e-7);
}

TEST_F(RoundSegment, WhereOneBallHoldsTheOther) {
  expect_exact([&] {
    const Vec3d centre{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    const double inner = uniform(0, 0.5), outer = uniform(0.5, 1);
    Segment segment{ball(centre, outer), ball(centre + any_direction() * (uniform(0, 1) * (outer - inner)), inner)};
    if (random_() % 2 == 0) std::swap(segment.first, segment.last);
    return std::pair(segment, any_ray(segment));
  });
}

// The inner sphere touches the outer one from inside, up to the rounding of float: H is about 0, of either sign.
TEST_F(RoundSegment, WhereOneBallHardlyHoldsTheOther) {
  expect_exact(
      [&] {
        const Vec3d centre{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
        const double inner = uniform(0, 0.5), outer = uniform(0.5, 1);
        Vec3d axis = any_direction();
        if (random_() % 2 == 0) axis = {1, 0, 0};
        const Segment segment{ball(centre, outer),
                              ball(centre + axis * ((outer - inner) * (1 + uniform(-1, 1) * 1e-7)), inner)};
        const Vec3d pole = centre + axis * outer + any_direction() * std::pow(10.0, uniform(-8, -1));
        return std::pair(segment, random_() % 2 == 0 ? any_ray(segment) : ray_to(pole + any_direction(), pole));
      },
      32);
}

TEST_F(RoundSegment, OfTheSameBallTwice) {
  expect_exact([&] {
    const Vec3d centre{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    const RoundBall one = ball(centre, uniform(0.1, 1));
    const Segment segment{one, one};
    return std::pair(segment, any_ray(segment));
  });
}

// Along the axis, parallel to it, and almost along it.
TEST_F(RoundSegment, LengthwiseRays) {
  expect_exact([&] {
    const double size = std::pow(10.0, uniform(-6, 0));
    const double first = size * uniform(0.5, 1), last = random_() % 2 == 0 ? first : size * uniform(0.5, 1);
    const Segment segment = any_segment(first, last);
    const Vec3d axis = centre_of(segment.last) - centre_of(segment.first);
    const Vec3d tilt = any_direction() * (random_() % 3 == 0 ? 0 : std::pow(10.0, uniform(-16, -1)));
    const double turn = random_() % 2 == 0 ? 1 : -1;
    const Vec3d from = target_in(segment, 1.05, uniform(0, 1)) - axis * (turn * uniform(-1, 3));
    return std::pair(segment, ray_along(from, (axis + tilt) * turn));
  });
}

// Exactly along the axis and a coordinate axis, with numbers that are not rounded.
TEST_F(RoundSegment, ExactChordsAlongTheAxis) {
  const auto chord_from = [](RoundBall first, RoundBall last, Vec3d origin, Vec3d direction) {
    return chord_of_segment(ray_along(origin, direction), first, last);
  };
  const RoundBall thick = ball({0, 0, 0}, 0.5), thin = ball({4, 0, 0}, 0.25), equal = ball({4, 0, 0}, 0.5);
  const RoundBall tip = ball({4, 0, 0}, 0), inner = ball({0.125, 0, 0}, 0.25);
  const auto expect_chord = [](Chord chord, double entry, double exit) {
    EXPECT_EQ(chord.entry, entry);
    EXPECT_EQ(chord.exit, exit);
  };
  expect_chord(chord_from(thick, equal, {-1, 0, 0}, {1, 0, 0}), 0.5, 5.5);
  expect_chord(chord_from(thick, equal, {-1, 0.5, 0}, {1, 0, 0}), 1, 5);       // along the cylinder's side
  expect_chord(chord_from(thick, equal, {2, 0, 0}, {-2, 0, 0}), -1.25, 1.25);  // from inside
  EXPECT_FALSE(is_hit(chord_from(thick, equal, {-1, 0.5000001, 0}, {1, 0, 0})));
  expect_chord(chord_from(thick, thin, {-1, 0, 0}, {1, 0, 0}), 0.5, 5.25);
  expect_chord(chord_from(thick, tip, {-1, 0, 0}, {1, 0, 0}), 0.5, 5);
  expect_chord(chord_from(inner, thick, {0, 2, 0}, {0, -1, 0}), 1.5, 2.5);
  expect_chord(chord_from(tip, tip, {0, 0, 0}, {1, 0, 0}), 4, 4);  // a sphere of radius 0, through its centre
}

TEST_F(RoundSegment, EndsAndWhereConesAndBallsTouch) {
  expect_exact([&] {
    const Segment segment = any_segment(uniform(0.05, 0.5), uniform(0.05, 0.5));
    const Vec3d first = centre_of(segment.first), axis = centre_of(segment.last) - first;
    const double length = perfect_bvh::length(axis);
    const double sine = (segment.first.radius - segment.last.radius) / length, cosine = std::sqrt(1 - sine * sine);
    const Vec3d across = normalized(cross(axis, any_direction()));
    const RoundBall& end = random_() % 2 == 0 ? segment.first : segment.last;
    const Vec3d seam = centre_of(end) + axis * (sine * end.radius / length) + across * (cosine * end.radius);
    return std::pair(segment, ray_to(seam + any_direction() * uniform(0.1, 3), seam));
  });
}

// The ray touches the hull's surface, at 1e-15 to 1e-3 of the radius inside or outside of it.
TEST_F(RoundSegment, TangentRays) {
  expect_exact([&] {
    const Segment segment = any_segment(uniform(0.05, 0.5), uniform(0.05, 0.5));
    const Vec3d first = centre_of(segment.first), axis = centre_of(segment.last) - first;
    const double length = perfect_bvh::length(axis), s = uniform(0, 1);
    const double sine = (segment.first.radius - segment.last.radius) / length, cosine = std::sqrt(1 - sine * sine);
    const Vec3d across = normalized(cross(axis, any_direction()));
    const Vec3d normal = across * cosine + axis * (sine / length);
    const double radius = segment.first.radius + s * (segment.last.radius - segment.first.radius);
    const double off = std::pow(10.0, uniform(-15, -3)) * (random_() % 2 == 0 ? 1 : -1);
    const Vec3d touched = first + axis * s + normal * (radius * (1 + off));
    const Vec3d along = normalized(cross(normal, any_direction()));
    return std::pair(segment, ray_along(touched - along * uniform(0, 3), along));
  });
}

// A zigzag's joints: rays through the shared sphere are inside both segments, as computed.
TEST_F(RoundSegment, NeighboursAgreeAboutTheBallTheyShare) {
  int hits = 0;
  for (int i = 0; i < 100000; ++i) {
    const double size = std::pow(10.0, uniform(-6, 0));
    const RoundBall shared = ball(any_direction(), size * uniform(0.5, 1));
    const RoundBall before = ball(any_direction(), size * uniform(0, 1)), after = ball(any_direction(), size);
    const Vec3d target = centre_of(shared) + any_direction() * (shared.radius * uniform(0.9, 1.0000001));
    const RoundRay ray = ray_to(any_direction() * uniform(0, 4), target);
    const Chord at_joint = chord_of_ball(ray, shared);
    const Chord first = chord_of_segment(ray, before, shared), second = chord_of_segment(ray, shared, after);
    if (!is_hit(at_joint)) continue;
    ++hits;
    for (const Chord& chord : {first, second}) {
      ASSERT_LE(chord.entry, at_joint.entry);
      ASSERT_GE(chord.exit, at_joint.exit);
    }
    ASSERT_LE(larger(first.entry, second.entry), smaller(first.exit, second.exit));
  }
  EXPECT_GT(hits, 10000);
}

// The same line from both sides, for any length of its direction.
TEST_F(RoundSegment, TurnedAndScaledRays) {
  for (int i = 0; i < 20000; ++i) {
    const Segment segment = any_segment(uniform(0, 1), uniform(0, 1));
    const RoundRay ray = any_ray(segment);
    const Chord chord = chord_of_segment(ray, segment.first, segment.last);
    double turned[3], longer[3];
    for (int axis = 0; axis < 3; ++axis) {
      turned[axis] = -ray.direction[axis], longer[axis] = 0x1p20 * ray.direction[axis];
    }
    const Chord back = chord_of_segment(round_ray(ray.origin, turned), segment.first, segment.last);
    const Chord quick = chord_of_segment(round_ray(ray.origin, longer), segment.first, segment.last);
    ASSERT_EQ(back.entry, -chord.exit);
    ASSERT_EQ(back.exit, -chord.entry);
    ASSERT_EQ(quick.entry * 0x1p20, chord.entry);
    ASSERT_EQ(quick.exit * 0x1p20, chord.exit);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
