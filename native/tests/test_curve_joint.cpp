// Which ends of segments' chords are on a curve's surface: compared with the union of all chords, found by sorting.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "math/curve_joint.h"

namespace perfect_bvh::test {
namespace {

struct End {
  double t;
  bool is_exit;
};

class CurveJoint : public testing::Test {
 protected:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3d any_direction() {
    std::normal_distribution<double> normal;
    return normalized(Vec3d{normal(random_), normal(random_), normal(random_)});
  }

  // Sets one curve through `points`. If it is closed, its last sphere is the first one again.
  void set_closed_curve(const std::vector<Vec3d>& points, const std::vector<double>& radii) {
    set_curve(points, radii);
    segments_.front() |= kSegmentBefore, segments_.back() |= kSegmentAfter;
    closed_ = {{0, static_cast<std::uint32_t>(segments_.size()) - 1}};
  }

  // Sets one curve through `points`.
  void set_curve(const std::vector<Vec3d>& points, const std::vector<double>& radii) {
    balls_.clear(), segments_.clear(), closed_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      balls_.push_back({to_float(points[i]), static_cast<float>(radii[i])});
    }
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const SegmentCode before = i > 0 ? kSegmentBefore : 0, after = i + 2 < points.size() ? kSegmentAfter : 0;
      segments_.push_back(static_cast<SegmentCode>(i) | before | after);
    }
  }
  [[nodiscard]] RoundList list() const {
    RoundList list{balls_.data(), segments_.data(), 1.0f};
    list.closed = closed_.data(), list.closed_count = closed_.size();
    return list;
  }

  RoundRay any_ray() {
    const Ball& ball = balls_[random_() % balls_.size()];
    const Vec3d target = to_double(ball.centre) + any_direction() * (uniform(0, 2) * static_cast<double>(ball.radius));
    const Vec3d origin = any_direction() * uniform(0, 5), direction = target - origin;
    return round_ray(&origin.x, &direction.x);
  }

  [[nodiscard]] std::vector<Chord> chords(const RoundRay& ray) const {
    std::vector<Chord> chords;
    for (std::uint32_t i = 0; i < segments_.size(); ++i) chords.push_back(chord_of(ray, list(), i));
    return chords;
  }
  // Returns the visible ends by t, an entry before an exit at the same t.
  [[nodiscard]] std::vector<End> shown(const RoundRay& ray) const {
    std::vector<End> ends;
    for (std::uint32_t i = 0; i < segments_.size(); ++i) {
      const Chord chord = chord_of(ray, list(), i);
      if (!is_hit(chord)) continue;
      const ShownEnds shows = shown_ends(ray, list(), i, chord);
      if (shows.entry) ends.push_back({chord.entry, false});
      if (shows.exit) ends.push_back({chord.exit, true});
    }
    sort(ends);
    return ends;
  }
  static void sort(std::vector<End>& ends) {
    std::sort(ends.begin(), ends.end(),
              [](const End& a, const End& b) { return a.t != b.t ? a.t < b.t : a.is_exit < b.is_exit; });
  }
  [[nodiscard]] static std::vector<End> ends_of_union(std::vector<Chord> chords) {
    std::sort(chords.begin(), chords.end(), [](const Chord& a, const Chord& b) { return a.entry < b.entry; });
    std::vector<End> ends;
    for (const Chord& chord : chords) {
      if (!is_hit(chord)) continue;
      if (ends.empty() || chord.entry > ends.back().t) {
        ends.push_back({chord.entry, false});
        ends.push_back({chord.exit, true});
      } else {
        ends.back().t = std::max(ends.back().t, chord.exit);
      }
    }
    return ends;
  }

  // For a curve that never comes near itself: its visible ends are those of the union, alternately in and out.
  void expect_union(int count) {
    int hits = 0;
    for (int i = 0; i < count; ++i) {
      const RoundRay ray = any_ray();
      const std::vector<End> found = shown(ray), expected = ends_of_union(chords(ray));
      hits += found.empty() ? 0 : 1;
      ASSERT_EQ(found.size(), expected.size()) << "ray " << i;
      for (std::size_t k = 0; k < found.size(); ++k) {
        ASSERT_EQ(found[k].t, expected[k].t) << "ray " << i;
        ASSERT_EQ(found[k].is_exit, k % 2 == 1) << "ray " << i;
      }
    }
    EXPECT_GT(hits, count / 4);
  }

  std::vector<Ball> balls_;
  std::vector<SegmentCode> segments_;
  std::vector<ClosedCurve> closed_;
  std::mt19937_64 random_{11};
};

TEST_F(CurveJoint, AZigzagIsMetInAndOutByTurns) {
  for (const double radius : {1e-5, 0.01, 0.12}) {
    std::vector<Vec3d> points;
    std::vector<double> radii;
    for (int i = 0; i < 12; ++i) {
      points.push_back({0.4 * i - 2, i % 2 == 0 ? -0.6 : 0.6, 0.1 * (i % 3)});
      radii.push_back(radius * (1 + 0.5 * (i % 2)));
    }
    set_curve(points, radii);
    expect_union(20000);
  }
}

// An open ring: its end almost reaches its start.
TEST_F(CurveJoint, ARingIsMetInAndOutByTurns) {
  std::vector<Vec3d> points;
  std::vector<double> radii;
  for (int i = 0; i < 32; ++i) {
    points.push_back({std::cos(0.19 * i), std::sin(0.19 * i), 0.0});
    radii.push_back(0.04 + 0.01 * std::sin(i));
  }
  set_curve(points, radii);
  expect_union(60000);
}

TEST_F(CurveJoint, AClosedRingIsMetInAndOutByTurns) {
  for (const int repeats : {1, 2, 3}) {
    std::vector<Vec3d> points;
    std::vector<double> radii;
    for (int i = 0; i <= 20 * repeats; ++i) {
      const int corner = i / repeats % 20;
      points.push_back({std::cos(0.314159 * corner), std::sin(0.314159 * corner), 0.0});
      radii.push_back(0.04 + 0.01 * std::sin(corner));
    }
    set_closed_curve(points, radii);
    expect_union(60000);
  }
}

// Each segment is a neighbour of all others: the union's ends are visible, and of coinciding ends only one.
TEST_F(CurveJoint, FewSegmentsThatCloseAreMetInAndOutByTurns) {
  const std::vector<std::vector<Vec3d>> shapes{{{0, 0, 0}, {1, 0, 0}},
                                               {{0, 0, 0}, {1, 0, 0}, {0.25, 1, 0}},
                                               {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}},
                                               {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
  for (std::vector<Vec3d> points : shapes) {
    points.push_back(points.front());
    set_closed_curve(points, std::vector<double>(points.size(), 0.25));
    expect_union(20000);
  }
}

TEST_F(CurveJoint, AStraightCurveIsMetAsOneWhole) {
  std::vector<Vec3d> points;
  for (int i = 0; i < 20; ++i) points.push_back({0.125 * i, 0, 0});
  set_curve(points, std::vector<double>(points.size(), 0.25));
  for (int i = 0; i < 20000; ++i) {
    const std::vector<End> found = shown(any_ray());
    ASSERT_TRUE(found.empty() || found.size() == 2) << "ray " << i << " meets " << found.size();
  }
}

// However the curve is bent, twisted and folded: the first entry and the last exit are visible, and from any point
// inside a curve there is a surface ahead.
TEST_F(CurveJoint, NoCurveLosesItsFirstOrLastSurface) {
  for (int curve = 0; curve < 300; ++curve) {
    std::vector<Vec3d> points{{0, 0, 0}};
    std::vector<double> radii{0.1};
    while (points.size() < 15) {
      const bool repeats = random_() % 6 == 0;
      points.push_back(repeats ? points.back() : points.back() + any_direction() * uniform(0, 0.4));
      radii.push_back(random_() % 5 == 0 ? radii.back() : random_() % 7 == 0 ? 0.0 : uniform(0, 0.3));
    }
    set_curve(points, radii);
    for (int i = 0; i < 300; ++i) {
      const RoundRay ray = any_ray();
      const std::vector<End> found = shown(ray), expected = ends_of_union(chords(ray));
      ASSERT_EQ(found.empty(), expected.empty());
      if (found.empty()) continue;
      ASSERT_EQ(found.front().t, expected.front().t);
      ASSERT_FALSE(found.front().is_exit);
      ASSERT_EQ(found.back().t, expected.back().t);
      ASSERT_TRUE(found.back().is_exit);
      // Every end of the union is visible; additional visible ends are inside of it.
      for (const End& end : expected) {
        ASSERT_TRUE(std::any_of(found.begin(), found.end(),
                                [&](const End& other) { return other.t == end.t && other.is_exit == end.is_exit; }));
      }
    }
  }
}

// The same segment twice in sequence: all ends coincide, and those of the first one are visible.
TEST_F(CurveJoint, OfEqualEndsTheFirstIsShown) {
  set_curve({{0, 0, 0}, {1, 0, 0}, {0, 0, 0}, {1, 0, 0}}, {0.25, 0.25, 0.25, 0.25});
  const double origin[3] = {0.5, 0.125, -2}, direction[3] = {0, 0, 1};
  const RoundRay ray = round_ray(origin, direction);
  for (std::uint32_t i = 0; i < 3; ++i) {
    const Chord chord = chord_of(ray, list(), i);
    ASSERT_TRUE(is_hit(chord));
    const ShownEnds shows = shown_ends(ray, list(), i, chord);
    EXPECT_EQ(shows.entry, i == 0) << i;
    EXPECT_EQ(shows.exit, i == 0) << i;
  }
}

TEST_F(CurveJoint, PointsHaveNoNeighbours) {
  balls_ = {{{0, 0, 0}, 0.5f}, {{0.25, 0, 0}, 0.5f}};
  const RoundList points{balls_.data(), nullptr, 2.0f};
  const double origin[3] = {-3, 0, 0}, direction[3] = {1, 0, 0};
  const RoundRay ray = round_ray(origin, direction);
  const Chord first = chord_of(ray, points, 0), second = chord_of(ray, points, 1);
  EXPECT_EQ(first.entry, 2.0);
  EXPECT_EQ(first.exit, 4.0);
  EXPECT_EQ(second.entry, 2.5);
  EXPECT_EQ(second.exit, 4.5);
  const ShownEnds shows = shown_ends(ray, points, 1, second);
  EXPECT_TRUE(shows.entry && shows.exit);
}

}  // namespace
}  // namespace perfect_bvh::test
