#include "query/round_judge.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace perfect_bvh {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double largest(Vec3d v) noexcept { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }
double size_of(const Affine& map) noexcept { return largest(map.x) + largest(map.y) + largest(map.z); }

// How far a point that is mapped to the mesh and back returns from where it was, in lengths of the mesh's axes.
double round_trip_error(const Affine& there, const Affine& back) noexcept {
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  double error = 0;
  for (const Vec3d axis : axes) error = std::max(error, largest(back.vector(there.vector(axis)) - axis));
  return error;
}

RoundBall grown(RoundBall ball, double by) noexcept {
  ball.radius += by;
  return ball;
}

// What is left of an end where all balls between it and the other one lose that much: the last one that has a radius.
// The other end has one. A tip of radius 0 is no part of the lesser hull: a ray through it may pass by the greater.
RoundBall lessened(RoundBall end, const RoundBall& other, double by) noexcept {
  const double own = end.radius - by, others = other.radius - by;
  end.radius = std::max(own, 0.0);
  if (own >= 0) return end;
  const double share = others / (others - own);
  for (int axis = 0; axis < 3; ++axis) {
    end.centre[axis] = other.centre[axis] + share * (end.centre[axis] - other.centre[axis]);
  }
  return end;
}

}  // namespace

RoundJudge::RoundJudge(const Instance& instance, const Ray& ray, double reach) noexcept
    : mesh_(instance.blas->mesh), list_(round_list(mesh_, moment_of(instance, ray.time))) {
  const Affine to_world = place_at(instance, ray.time);
  const Affine to_object = inverse(to_world);
  const Vec3d origin = to_object.point(ray.origin), direction = to_object.vector(ray.direction);
  ray_ = round_ray(&origin.x, &direction.x);
  const double mapped = size_of(to_object) * (largest(ray.origin) + largest(to_world.translation));
  const double distance = mapped + reach;
  margin_ = (0x1p-40 + 4 * round_trip_error(to_world, to_object)) * distance;
}

RoundJudge::JudgedChord RoundJudge::chord_of(std::uint32_t primitive) const noexcept {
  const RoundEnds ends = ends_of(list_, primitive);
  const Chord possible = chord_of_segment(ray_, grown(ends.first, margin_), grown(ends.last, margin_));
  const bool is_thin = ends.first.radius <= margin_ && ends.last.radius <= margin_;
  const Chord sure = is_thin ? kNoChord
                             : chord_of_segment(ray_, lessened(ends.first, ends.last, margin_),
                                                lessened(ends.last, ends.first, margin_));
  return {sure, possible};
}

JudgedRibbon RoundJudge::ribbon_of(std::uint32_t primitive) const noexcept {
  const RoundEnds ends = ends_of(list_, primitive);
  return judge_ribbon(ray_, ends, mesh_.segments[primitive], margin_);
}

// Which of those that may be the nearest is it, is not to be known: from one to the next for as long as it may be
// nearer than the one before.
JudgedEnd RoundJudge::meeting_of(std::uint32_t primitive) const noexcept {
  constexpr JudgedEnd kMissed{true, false, true, kInfinity, 0, kInfinity, kInfinity};
  const JudgedRibbon own = ribbon_of(primitive);
  if (!own.is_possible) return kMissed;
  bool is_sure = own.is_sure;
  double least = own.least, most = own.most;
  for (const int step : {-1, 1}) {
    JudgedRibbon last = own;
    bool is_first = true;
    for (std::uint32_t at = next(primitive, step); at != kNoSegment && at != primitive; at = next(at, step)) {
      const JudgedRibbon other = ribbon_of(at);
      if (is_first && other.farthest < own.nearest) return kMissed;
      if (other.nearest > last.farthest) break;
      is_sure &= other.is_sure;
      least = std::min(least, other.least), most = std::max(most, other.most);
      last = other, is_first = false;
    }
  }
  const double t = 0.5 * (own.least + own.most);
  const double rounding = 0x1p-22 * std::max(std::abs(least), std::abs(most)) + 0x1p-140;
  return {false, is_sure, true, t, 0.5 * (own.most - own.least) + rounding, least - rounding, most + rounding};
}

RoundJudge::JudgedChord RoundJudge::beside(std::uint32_t primitive, int step) const noexcept {
  const std::uint32_t other = next(primitive, step);
  return other == kNoSegment ? JudgedChord{kNoChord, kNoChord} : chord_of(other);
}

std::uint32_t RoundJudge::next(std::uint32_t primitive, int step) const noexcept {
  if (mesh_.kind != PrimitiveKind::kCurves) return kNoSegment;
  return neighbour_of(list_, primitive, step < 0 ? Along::kBefore : Along::kAfter);
}

// An entry is hidden where the neighbour's chord begins before it and ends after it; an exit likewise.
void RoundJudge::judge_beside(const JudgedChord& other, JudgedEnd& end) noexcept {
  if (other.sure.entry < end.t - end.bound && other.sure.exit > end.t + end.bound) end.surely_missed = true;
}

// From one to the next for as long as it may hide the one before.
void RoundJudge::reach_along(std::uint32_t primitive, int step, JudgedEnd& end) const noexcept {
  double low = end.t - end.bound, high = end.t + end.bound;
  for (std::uint32_t at = next(primitive, step); at != kNoSegment && at != primitive; at = next(at, step)) {
    const JudgedChord other = chord_of(at);
    if (!(other.possible.entry <= high && low <= other.possible.exit)) return;
    const JudgedEnd next = end_of(other, end.is_entry);
    low = next.t - next.bound, high = next.t + next.bound;
    end.least = std::min(end.least, end.is_entry ? low : end.least);
    end.most = std::max(end.most, end.is_entry ? end.most : high);
  }
}

// Between the two chords' ends; rounding t to float besides.
JudgedEnd RoundJudge::end_of(const JudgedChord& chord, bool is_entry) noexcept {
  if (!is_hit(chord.possible)) return {true, false, is_entry, kInfinity, 0, kInfinity, kInfinity};
  const bool is_sure = is_hit(chord.sure);
  const double from = is_entry ? chord.possible.entry : is_sure ? chord.sure.exit : chord.possible.entry;
  const double to = !is_entry ? chord.possible.exit : is_sure ? chord.sure.entry : chord.possible.exit;
  const double t = 0.5 * (from + to), bound = 0.5 * std::abs(to - from) + 0x1p-22 * std::abs(t) + 0x1p-140;
  return {false, is_sure, is_entry, t, bound, t - bound, t + bound};
}

std::array<JudgedEnd, 2> RoundJudge::ends(std::uint32_t primitive) const noexcept {
  if (mesh_.shape == CurveShape::kRibbon) {
    const JudgedEnd meeting = meeting_of(primitive);
    return {meeting, {true, false, false, kInfinity, 0, kInfinity, kInfinity}};
  }
  const JudgedChord chord = chord_of(primitive);
  std::array<JudgedEnd, 2> ends{end_of(chord, true), end_of(chord, false)};
  if (!is_hit(chord.possible)) return ends;
  for (JudgedEnd& end : ends) {
    for (const int step : {-1, 1}) {
      judge_beside(beside(primitive, step), end);
      if (!end.surely_missed) reach_along(primitive, step, end);
    }
  }
  return ends;
}

std::ranges::iota_view<std::uint32_t, std::uint32_t> primitives_of(const Mesh& mesh, std::int32_t number) noexcept {
  const auto row = static_cast<std::uint32_t>(number);
  if (number < 0) return {0, 0};
  if (mesh.kind == PrimitiveKind::kPoints) {
    if (mesh.numbers.empty())
      return row < mesh.balls.size() ? std::views::iota(row, row + 1) : std::views::iota(0u, 0u);
    const auto* const end = mesh.numbers.end() - 1;
    const auto* const found = std::lower_bound(mesh.numbers.begin(), end, row);
    const auto kept = static_cast<std::uint32_t>(found - mesh.numbers.begin());
    return found != end && *found == row ? std::views::iota(kept, kept + 1) : std::views::iota(0u, 0u);
  }
  if (row + 1 >= mesh.starts.size()) return {0, 0};
  const auto first_from = [&](std::uint32_t ball) {
    const auto* const found = std::partition_point(mesh.segments.begin(), mesh.segments.end(),
                                                   [&](SegmentCode code) { return (code & kSegmentBall) < ball; });
    return static_cast<std::uint32_t>(found - mesh.segments.begin());
  };
  return {first_from(mesh.starts[row]), first_from(mesh.starts[row + 1])};
}

// Ribbon judge --------------------------------------------------------------------------------------------------------

namespace {

// From where to where on the axis the ray may come nearest to it: outside of 0 to 1 if that would be beyond its ends.
struct Shares {
  double low, high;
};

// The axis, seen along the ray, is so long: moving its ends moves the place the more the shorter that is, and the
// farther the ray passes it.
Shares shares_of(const NearestToCentre& first, const NearestToCentre& last, double distance, double margin) noexcept {
  double step[3];
  for (int i = 0; i < 3; ++i) step[i] = last.point[i] - first.point[i];
  const double length = std::sqrt(dot_of(step, step));
  if (!(length > 16 * margin)) return {-1.0, 2.0};
  const double share = -dot_of(first.point, step) / (length * length);
  const double off = 16 * margin / length * (1 + distance / length + std::abs(share));
  return {share - off, share + off};
}

}  // namespace

JudgedRibbon judge_ribbon(const RoundRay& ray, const RoundEnds& ends, SegmentCode code, double margin) noexcept {
  const NearestToCentre first = nearest_to_centre(ray, ends.first), last = nearest_to_centre(ray, ends.last);
  const double distance = std::sqrt(place_on_ribbon(ray, ends.first, ends.last).squared);
  const Shares shares = shares_of(first, last, distance, margin);
  const double low = std::clamp(shares.low, 0.0, 1.0), high = std::clamp(shares.high, 0.0, 1.0);
  const auto [thin, thick] =
      std::minmax({radius_at(ends.first, ends.last, low), radius_at(ends.first, ends.last, high)});
  const bool cuts_first = (code & kSegmentBefore) == 0, cuts_last = (code & kSegmentAfter) == 0;
  const bool is_cut = (cuts_first && shares.high < 0) || (cuts_last && shares.low > 1);
  const bool may_be_cut = (cuts_first && shares.low < 0) || (cuts_last && shares.high > 1);
  const auto [t_low, t_high] = std::minmax({first.t + low * (last.t - first.t), first.t + high * (last.t - first.t)});
  const double slack = margin / std::sqrt(ray.squared_length);
  const double nearest = std::max(distance - margin, 0.0), farthest = distance + margin;
  return {
      !is_cut && nearest <= thick, !may_be_cut && farthest <= thin, t_low - slack, t_high + slack, nearest, farthest};
}

}  // namespace perfect_bvh
