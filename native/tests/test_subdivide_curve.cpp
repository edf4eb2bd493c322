// Chains of spheres instead of curves: within the stated distance, equal to Blender's evaluation of the curves, and the
// same on any number of threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/thread_pool.h"
#include "math/round_segment.h"
#include "mesh/subdivide_curve.h"

namespace perfect_bvh::test {
namespace {

struct Curves {
  CurveKind kind = CurveKind::kPoly;
  std::vector<Vec3d> points;
  std::vector<double> radii;
  std::vector<std::int64_t> offsets;
  std::vector<std::uint8_t> is_cyclic;

  [[nodiscard]] ControlCurves<double> view() const { return {kind, points, radii, offsets, is_cyclic}; }
};

struct Chain {
  std::vector<Vec3d> centres;
  std::vector<double> radii;
};

void here(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) { body(0, count); }

Chain written(const Curves& curves, const Subdivision& subdivision, const RangeLoop& loop = here) {
  Chain chain{std::vector<Vec3d>(subdivision.ball_count()), std::vector<double>(subdivision.ball_count())};
  write_balls<double>(curves.view(), subdivision, chain.centres, chain.radii, loop, "test");
  return chain;
}

const std::vector<Vec3d> kFive = {{0, 0, 0}, {1, 2, 0}, {3, 1, 1}, {4, -1, 0}, {5, 0, 2}};
const std::vector<double> kFiveRadii = {0.1, 0.2, 0.5, 0.3, 0.0};

Curves one_curve(CurveKind kind, bool is_cyclic) { return {kind, kFive, kFiveRadii, {0, 5}, {is_cyclic}}; }

Curves random_curves(CurveKind kind, std::size_t curve_count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> step(0.0, 1.0);
  Curves curves{kind, {}, {}, {0}, {}};
  for (std::size_t curve = 0; curve < curve_count; ++curve) {
    const bool is_cyclic = random() % 3 == 0;
    std::size_t count = 2 + random() % 9;
    if (kind == CurveKind::kBezier) count = count * 3 + (is_cyclic ? 0 : 1);
    for (std::size_t k = 0; k < count; ++k) {
      curves.points.push_back({step(random), step(random), step(random)});
      curves.radii.push_back(random() % 4 == 0 ? 0.0 : std::abs(step(random)));
    }
    curves.offsets.push_back(static_cast<std::int64_t>(curves.points.size()));
    curves.is_cyclic.push_back(is_cyclic);
  }
  return curves;
}

void expect_ball(const Chain& chain, std::size_t row, Vec3d centre, double radius) {
  EXPECT_LT(length(chain.centres[row] - centre), 2e-6) << row;
  EXPECT_NEAR(chain.radii[row], radius, 1e-6) << row;
}

// Rows of the result of bpy 5.0.1's node Curve to Mesh for the same control points at a resolution of 4.
TEST(SubdivideCurve, RunsAsBlenderEvaluatesCurves) {
  const Curves open = one_curve(CurveKind::kCatmullRom, false), closed = one_curve(CurveKind::kCatmullRom, true);
  Chain chain = written(open, subdivide_evenly(open.view(), 4, "test"));
  ASSERT_EQ(chain.radii.size(), 17u);
  const double of_open[] = {0.1,    0.11328125, 0.13125, 0.15859375, 0.2,   0.27265625, 0.36875, 0.45546875, 0.5,
                            0.4875, 0.4375,     0.36875, 0.3,        0.225, 0.1375,     0.05625, 0.0};
  for (std::size_t k = 0; k < 17; ++k) EXPECT_NEAR(chain.radii[k], of_open[k], 1e-6) << k;
  chain = written(closed, subdivide_evenly(closed.view(), 4, "test"));
  ASSERT_EQ(chain.radii.size(), 21u);
  EXPECT_NEAR(chain.radii[1], 0.1203125, 1e-6);
  EXPECT_NEAR(chain.radii[15], 0.04921875, 1e-6);
  EXPECT_EQ(chain.radii[20], 0.1);

  const Curves spline = one_curve(CurveKind::kBSpline, false), ring = one_curve(CurveKind::kBSpline, true);
  chain = written(spline, subdivide_evenly(spline.view(), 4, "test"));
  ASSERT_EQ(chain.radii.size(), 9u);
  expect_ball(chain, 0, {1.1666667, 1.5, 0.1666667}, 0.2333333);
  expect_ball(chain, 1, {1.5677083, 1.5364583, 0.3151042}, 0.28776042);
  expect_ball(chain, 8, {4.0, -0.5, 0.5}, 0.2833333);
  chain = written(ring, subdivide_evenly(ring.view(), 4, "test"));
  ASSERT_EQ(chain.radii.size(), 21u);
  expect_ball(chain, 9, {4.234375, -0.5416667, 0.7005208}, 0.2190104);
  expect_ball(chain, 19, {0.8359375, 1.2942708, 0.0755208}, 0.1890625);
  EXPECT_EQ(chain.centres[20], chain.centres[0]);
}

TEST(SubdivideCurve, TakesASplineOfThreePointsForAPoly) {
  for (const bool is_cyclic : {false, true}) {
    const Curves curves{CurveKind::kBSpline, {kFive.begin(), kFive.begin() + 3}, {0.5}, {0, 3}, {is_cyclic}};
    const Chain chain = written(curves, subdivide(curves.view(), 1e-3, here, "test"));
    ASSERT_EQ(chain.centres.size(), is_cyclic ? 4u : 3u);
    for (std::size_t k = 0; k < chain.centres.size(); ++k) EXPECT_EQ(chain.centres[k], kFive[k % 3]);
  }
}

TEST(SubdivideCurve, LeavesAStraightCurveInOnePieceASpan) {
  Curves curves{CurveKind::kBezier, {}, {}, {0, 7}, {}};
  for (int k = 0; k < 7; ++k) curves.points.push_back({k * 1.5, k * -0.5, 3.0}), curves.radii.push_back(0.25 * k);
  EXPECT_EQ(subdivide(curves.view(), 1e-6, here, "test").ball_count(), 3u);
}

class Kinds : public testing::TestWithParam<CurveKind> {};
INSTANTIATE_TEST_SUITE_P(All, Kinds,
                         testing::Values(CurveKind::kPoly, CurveKind::kCatmullRom, CurveKind::kBezier,
                                         CurveKind::kBSpline));

// Compared with chains that are fine enough to represent the curve.
TEST_P(Kinds, StayWithinTheTolerance) {
  const Curves curves = random_curves(GetParam(), 100, 5);
  constexpr std::uint32_t kFine = 256;
  const Subdivision fine = subdivide_evenly(curves.view(), kFine, "test");
  const Chain curve = written(curves, fine);
  for (const double tolerance : {1.0, 0.1, 1e-3}) {
    const Subdivision coarse = subdivide(curves.view(), tolerance, here, "test");
    const Chain chain = written(curves, coarse);
    double most = 0.0;
    for (std::size_t span = 0; span < coarse.span_count(); ++span) {
      const std::size_t row = coarse.first_balls[span], from = fine.first_balls[span];
      const bool ends = std::ranges::count(coarse.first_spans, static_cast<std::int64_t>(span) + 1) != 0;
      const std::size_t pieces = coarse.first_balls[span + 1] - row - (ends ? 1 : 0);
      const std::size_t steps = fine.first_balls[span + 1] - from - (ends ? 1 : 0);
      for (std::size_t k = 0; k <= steps; ++k) {
        const double place = static_cast<double>(k * pieces) / static_cast<double>(steps);
        const std::size_t piece = std::min(static_cast<std::size_t>(place), pieces - 1);
        const double share = place - static_cast<double>(piece);
        const Vec3d centre = chain.centres[row + piece] * (1 - share) + chain.centres[row + piece + 1] * share;
        const double radius = chain.radii[row + piece] * (1 - share) + chain.radii[row + piece + 1] * share;
        most = std::max(most, length(centre - curve.centres[from + k]) + std::abs(radius - curve.radii[from + k]));
      }
    }
    EXPECT_LE(most, tolerance + 1e-14);
    if (GetParam() != CurveKind::kPoly && tolerance == 1e-3) {
      EXPECT_GT(most, 0.2 * tolerance);  // and no finer than requested
    }
  }
  for (const double radius : curve.radii) ASSERT_GE(radius, 0.0);
}

TEST_P(Kinds, MakeTheSameChainsOnAnyNumberOfThreads) {
  const Curves curves = random_curves(GetParam(), 3000, 6);
  const Subdivision alone = subdivide(curves.view(), 1e-2, here, "test");
  const Chain chain = written(curves, alone);
  for (const int thread_count : {2, 4}) {
    ThreadPool pool(thread_count);
    const RangeLoop loop = [&](std::size_t count, const auto& body) { parallel_for(pool, count, 7, body); };
    const Subdivision shared = subdivide(curves.view(), 1e-2, loop, "test");
    EXPECT_EQ(shared.first_balls, alone.first_balls);
    const Chain same = written(curves, shared, loop);
    EXPECT_EQ(same.centres, chain.centres);
    EXPECT_EQ(same.radii, chain.radii);
  }
}

TEST_P(Kinds, KeepTheirPiecesWhenPointsMove) {
  Curves curves = random_curves(GetParam(), 50, 7);
  const Subdivision subdivision = subdivide(curves.view(), 1e-2, here, "test");
  for (Vec3d& point : curves.points) point = point * 3.0 + Vec3d{1, 2, 3};
  const Chain moved = written(curves, subdivision);
  const std::vector<std::int64_t> offsets = subdivision.ball_offsets();
  ASSERT_EQ(offsets.size(), curves.offsets.size());
  for (std::size_t curve = 0; curve + 1 < offsets.size(); ++curve) {
    const auto first = static_cast<std::size_t>(offsets[curve]), end = static_cast<std::size_t>(offsets[curve + 1]);
    ASSERT_GE(end, first + 2);
    if (curves.is_cyclic[curve]) {
      EXPECT_EQ(moved.centres[first], moved.centres[end - 1]);
    }
    if (GetParam() == CurveKind::kBSpline) continue;
    EXPECT_EQ(moved.centres[first], curves.points[static_cast<std::size_t>(curves.offsets[curve])]);
  }
  curves.is_cyclic[0] = !curves.is_cyclic[0];
  if (GetParam() != CurveKind::kBezier) {
    EXPECT_THROW(written(curves, subdivision), InvalidArgument);
  }
}

TEST_P(Kinds, DivideAllSpansOfACurveAlike) {
  const Curves curves = random_curves(GetParam(), 50, 8);
  const Subdivision subdivision = subdivide(curves.view(), 1e-2, here, "test");
  std::int64_t most = 0;
  for (std::size_t curve = 0; curve + 1 < curves.offsets.size(); ++curve) {
    const auto first = static_cast<std::size_t>(subdivision.first_spans[curve]);
    const auto end = static_cast<std::size_t>(subdivision.first_spans[curve + 1]);
    const std::int64_t balls = subdivision.ball_offsets()[curve + 1] - subdivision.ball_offsets()[curve];
    const std::int64_t pieces = (balls - 1) / static_cast<std::int64_t>(end - first);
    EXPECT_EQ(pieces * static_cast<std::int64_t>(end - first) + 1, balls);
    for (std::size_t span = first; span + 1 < end; ++span) {
      EXPECT_EQ(subdivision.first_balls[span + 1] - subdivision.first_balls[span], pieces);
    }
    most = std::max(most, pieces);
  }
  EXPECT_EQ(most > 1, GetParam() != CurveKind::kPoly);
}

TEST_P(Kinds, TellWhetherTheirPiecesSuffice) {
  Curves curves = random_curves(GetParam(), 50, 9);
  const Subdivision coarse = subdivide(curves.view(), 1e-1, here, "test");
  const Subdivision fine = subdivide(curves.view(), 1e-3, here, "test");
  EXPECT_TRUE(fine.is_as_fine_as(coarse) && coarse.is_as_fine_as(coarse));
  EXPECT_EQ(coarse.is_as_fine_as(fine), GetParam() == CurveKind::kPoly);
  curves.is_cyclic.assign(curves.is_cyclic.size(), 0);
  if (GetParam() == CurveKind::kBezier) return;
  EXPECT_FALSE(fine.is_as_fine_as(subdivide(curves.view(), 1.0, here, "test")));
}

TEST(SubdivideCurve, TakesNoCurvesAtAll) {
  const Curves none{CurveKind::kCatmullRom, {}, {0.5}, {0}, {}};
  const Subdivision subdivision = subdivide(none.view(), 0.1, here, "test");
  EXPECT_EQ(subdivision.ball_count(), 0u);
  EXPECT_EQ(subdivision.ball_offsets(), std::vector<std::int64_t>{0});
  EXPECT_TRUE(written(none, subdivision).centres.empty());
}

void expect_refused(const Curves& curves, double tolerance, const std::string& words) {
  try {
    const Subdivision subdivision = subdivide(curves.view(), tolerance, here, "add_curves");
    ADD_FAILURE() << "took " << subdivision.ball_count() << " balls instead of saying " << words;
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find("add_curves: "), std::string::npos);
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(SubdivideCurve, RefusesWhatDoesNotFit) {
  const Curves good = one_curve(CurveKind::kCatmullRom, false);
  const auto with = [&](auto change) {
    Curves changed = good;
    change(changed);
    return changed;
  };
  expect_refused(good, 0.0, "tolerance");
  expect_refused(good, std::numeric_limits<double>::quiet_NaN(), "tolerance");
  expect_refused(good, 1e-300, "2**30 spheres");
  expect_refused(with([](Curves& c) { c.points[2].x = std::numeric_limits<double>::quiet_NaN(); }), 0.1,
                 "2**30 spheres");
  expect_refused(with([](Curves& c) { c.offsets = {}; }), 0.1, "got none");
  expect_refused(with([](Curves& c) { c.offsets = {0, 4}; }), 0.1, "got 0 to 4");
  expect_refused(with([](Curves& c) { c.offsets = {1, 5}; }), 0.1, "got 1 to 5");
  expect_refused(with([](Curves& c) { c.offsets = {0, 4, 2, 5}, c.is_cyclic = {}; }), 0.1, "must not descend");
  expect_refused(with([](Curves& c) { c.offsets = {0, 9, 5}, c.is_cyclic = {}; }), 0.1, "must not descend");
  expect_refused(with([](Curves& c) { c.offsets = {0, 4, 5}, c.is_cyclic = {}; }), 0.1, "curve 1 must have 2 points");
  expect_refused(with([](Curves& c) { c.is_cyclic = {0, 0}; }), 0.1, "cyclic must have a row");
  expect_refused(with([](Curves& c) { c.radii = {0.1, 0.2}; }), 0.1, "radii must be one number or one a point");
  expect_refused(with([](Curves& c) { c.kind = CurveKind::kBezier; }), 0.1, "3 n + 1 points");
  expect_refused(with([](Curves& c) { c.kind = CurveKind::kBezier, c.is_cyclic = {1}; }), 0.1, "3 n points");
}

}  // namespace
}  // namespace perfect_bvh::test
