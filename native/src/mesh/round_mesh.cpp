#include "mesh/round_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

constexpr double kLargest = 1e18;  // as for vertices: areas must stay finite in float

std::string to_text(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

[[noreturn]] void refuse(const char* function, const std::string& what) {
  throw InvalidArgument(std::string(function) + ": " + what);
}

template <class T>
[[noreturn]] void complain_of_centres(std::span<const Vec3<T>> centres, const char* name, const char* function) {
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const Vec3<T>& p = centres[i];
    if (is_finite(p) && std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= static_cast<T>(kLargest)) continue;
    const auto number = [](T value) { return to_text(static_cast<double>(value)); };
    refuse(function, std::string(name) + "[" + std::to_string(i) +
                         "] must be finite and at most 1e18 in magnitude, got (" + number(p.x) + ", " + number(p.y) +
                         ", " + number(p.z) + "); leave it out, or scale the data down and its instances up");
  }
  refuse(function, std::string(name) + " must be finite and at most 1e18 in magnitude");
}

template <class T>
void check_radii(std::span<const T> radii, const char* function) {
  std::uint32_t wrong = 0;  // as for NaN; without a branch, to check several at once
  for (const T radius : radii) wrong |= radius >= 0 && radius <= static_cast<T>(kLargest) ? 0u : 1u;
  if (wrong == 0) return;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    if (radii[i] >= 0 && radii[i] <= static_cast<T>(kLargest)) continue;
    refuse(function, "radii[" + std::to_string(i) + "] must be at least 0 and at most 1e18, got " +
                         to_text(static_cast<double>(radii[i])) + "; a primitive whose radii are 0 is left out");
  }
}

template <class T>
AlignedVector<Ball> copy_balls(const BallsGiven<T>& given, Vec3d centre) {
  AlignedVector<Ball> balls(given.centres.size());
  for (std::size_t i = 0; i < balls.size(); ++i) balls[i] = ball_at(given, i, centre);
  return balls;
}

AlignedVector<std::uint32_t> copy_starts(std::span<const std::int64_t> offsets) {
  AlignedVector<std::uint32_t> starts(offsets.size());
  std::ranges::transform(offsets, starts.begin(), [](std::int64_t at) { return static_cast<std::uint32_t>(at); });
  return starts;
}

template <class T>
Vec3d centre_of(std::span<const Vec3<T>> centres) noexcept {
  if constexpr (sizeof(T) == sizeof(double)) return box_centre(centres);
  return {0, 0, 0};
}

constexpr std::size_t kMostBalls = std::size_t{kSegmentBall} + 1;

void check_ball_count(std::size_t count, const char* name, const char* function) {
  if (count <= kMostBalls) return;
  refuse(function, std::string(name) + " has " + std::to_string(count) + " rows but a mesh holds at most " +
                       std::to_string(kMostBalls) + "; divide it");
}

void check_offsets(std::span<const std::int64_t> offsets, std::size_t ball_count, const char* function) {
  if (offsets.empty() || offsets.front() != 0) {
    refuse(function, "curve_offsets must begin with 0 and have one entry more than there are curves, got " +
                         (offsets.empty() ? std::string("none") : std::to_string(offsets.front())) + " first");
  }
  for (std::size_t i = 1; i < offsets.size(); ++i) {
    // offsets[i - 1] >= 0, so the difference cannot overflow.
    if (offsets[i] > offsets[i - 1] && offsets[i] - offsets[i - 1] >= 2) continue;
    refuse(function, "curve_offsets[" + std::to_string(i) +
                         "] must be at least 2 more than the one before it (a curve has 2 points or more), got " +
                         std::to_string(offsets[i]) + " after " + std::to_string(offsets[i - 1]) +
                         "; leave shorter curves out");
  }
  if (static_cast<std::size_t>(offsets.back()) != ball_count) {
    refuse(function, "curve_offsets must end with the number of points, " + std::to_string(ball_count) + ", got " +
                         std::to_string(offsets.back()));
  }
}

void check_cyclic(std::span<const std::uint8_t> cyclic, std::size_t curve_count, const char* function) {
  if (cyclic.empty() || cyclic.size() == curve_count) return;
  refuse(function, "cyclic must have one entry for each curve, " + std::to_string(curve_count) + ", or none, got " +
                       std::to_string(cyclic.size()));
}

// Segments are in the order of their spheres; omitted ones separate their neighbours.
void list_segments(Mesh& mesh) {
  AlignedVector<SegmentCode> segments;
  AlignedVector<ClosedCurve> closed;
  segments.reserve(mesh.balls.size());
  for (std::size_t curve = 0; curve + 1 < mesh.starts.size(); ++curve) {
    const auto first = static_cast<std::uint32_t>(segments.size());
    bool has_before = false;
    for (std::uint32_t ball = mesh.starts[curve]; ball + 1 < mesh.starts[curve + 1]; ++ball) {
      const bool is_shown = mesh.balls[ball].radius > 0 || mesh.balls[ball + 1].radius > 0;
      if (is_shown && has_before) segments.back() |= kSegmentAfter;
      if (is_shown) segments.push_back(ball | (has_before ? kSegmentBefore : 0u));
      has_before = is_shown;
    }
    // Its last segment exists; so does its first one, if the chain's ends match.
    const bool is_cyclic = !mesh.cyclic.empty() && mesh.cyclic[curve] != 0;
    if (!is_cyclic || !has_before || (segments[first] & kSegmentBall) != mesh.starts[curve]) continue;
    const auto last = static_cast<std::uint32_t>(segments.size()) - 1;
    if (last == first) continue;
    segments[first] |= kSegmentBefore, segments[last] |= kSegmentAfter;
    closed.push_back({first, last});
  }
  mesh.segments = std::move(segments);
  if (!closed.empty()) mesh.closed = std::move(closed);
}

void leave_out_points(Mesh& mesh) {
  const auto is_nothing = [](const Ball& ball) { return !(ball.radius > 0); };
  if (std::none_of(mesh.balls.begin(), mesh.balls.end(), is_nothing)) return;
  AlignedVector<std::uint32_t> numbers;
  for (std::size_t i = 0; i < mesh.balls.size(); ++i) {
    if (is_nothing(mesh.balls[i])) continue;
    mesh.balls[numbers.size()] = mesh.balls[i];
    numbers.push_back(static_cast<std::uint32_t>(i));
  }
  const std::size_t kept = numbers.size();
  numbers.push_back(static_cast<std::uint32_t>(mesh.balls.size()));
  mesh.balls.resize(kept);
  mesh.numbers = std::move(numbers);
}

}  // namespace

template <class T>
void check_balls(const BallsGiven<T>& balls, PrimitiveKind kind, const char* function) {
  const char* const name = names_of(kind).vertices;
  if (balls.radii.size() != 1 && balls.radii.size() != balls.centres.size()) {
    refuse(function, "radii must have one entry for each row of " + std::string(name) + ", " +
                         std::to_string(balls.centres.size()) + ", or be one number, got " +
                         std::to_string(balls.radii.size()));
  }
  if (!are_good(balls.centres)) complain_of_centres(balls.centres, name, function);
  check_radii(balls.radii, function);
}
template void check_balls(const BallsGiven<float>&, PrimitiveKind, const char*);
template void check_balls(const BallsGiven<double>&, PrimitiveKind, const char*);

template <class T>
Mesh make_points(const BallsGiven<T>& balls, const char* function) {
  check_ball_count(balls.centres.size(), "centers", function);
  check_balls(balls, PrimitiveKind::kPoints, function);
  Mesh mesh;
  mesh.kind = PrimitiveKind::kPoints;
  mesh.centre = centre_of(balls.centres);
  mesh.balls = copy_balls(balls, mesh.centre);
  leave_out_points(mesh);
  return mesh;
}
template Mesh make_points(const BallsGiven<float>&, const char*);
template Mesh make_points(const BallsGiven<double>&, const char*);

template <class T>
Mesh make_curves(const BallsGiven<T>& balls, std::span<const std::int64_t> offsets, CurveShape shape,
                 const char* function, std::span<const std::uint8_t> cyclic) {
  check_ball_count(balls.centres.size(), "points", function);
  check_offsets(offsets, balls.centres.size(), function);
  check_cyclic(cyclic, offsets.size() - 1, function);
  check_balls(balls, PrimitiveKind::kCurves, function);
  Mesh mesh;
  mesh.kind = PrimitiveKind::kCurves, mesh.shape = shape;
  mesh.centre = centre_of(balls.centres);
  mesh.balls = copy_balls(balls, mesh.centre);
  mesh.starts = copy_starts(offsets);
  if (std::ranges::find(cyclic, 1) != cyclic.end()) {
    mesh.cyclic = AlignedVector<std::uint8_t>(cyclic.begin(), cyclic.end());
  }
  list_segments(mesh);
  return mesh;
}
template Mesh make_curves(const BallsGiven<float>&, std::span<const std::int64_t>, CurveShape, const char*,
                          std::span<const std::uint8_t>);
template Mesh make_curves(const BallsGiven<double>&, std::span<const std::int64_t>, CurveShape, const char*,
                          std::span<const std::uint8_t>);

template <class T>
Mesh make_again(const Mesh& mesh, const BallsGiven<T>& balls, const char* function) {
  if (mesh.kind == PrimitiveKind::kPoints) return make_points(balls, function);
  const std::vector<std::int64_t> offsets(mesh.starts.begin(), mesh.starts.end());
  return make_curves(balls, offsets, mesh.shape, function, mesh.cyclic_curves());
}
template Mesh make_again(const Mesh&, const BallsGiven<float>&, const char*);
template Mesh make_again(const Mesh&, const BallsGiven<double>&, const char*);

std::size_t CurveTraits::part_count(const Mesh& mesh) noexcept {
  return mesh.starts.empty() ? 0 : mesh.starts.size() - 1;  // 0 after flattening
}

std::size_t CurveTraits::left_out_count(const Mesh& mesh) noexcept {
  return mesh.balls.size() - (mesh.starts.size() - 1) - mesh.segments.size();
}

namespace {

struct PlaceOnCurve {
  std::uint32_t curve, segment, segment_count;
};

PlaceOnCurve place_on_curve(const Mesh& mesh, std::uint32_t primitive) noexcept {
  const std::uint32_t ball = CurveTraits::first_ball(mesh, primitive);
  const auto after = std::upper_bound(mesh.starts.begin(), mesh.starts.end(), ball);
  const std::uint32_t first = *(after - 1);
  return {static_cast<std::uint32_t>(after - mesh.starts.begin()) - 1, ball - first, *after - first - 1};
}

}  // namespace

std::uint32_t CurveTraits::caller_number(const Mesh& mesh, std::uint32_t primitive) noexcept {
  return place_on_curve(mesh, primitive).curve;
}

float CurveTraits::u_of_part(const Mesh& mesh, std::uint32_t primitive, float u) noexcept {
  const PlaceOnCurve place = place_on_curve(mesh, primitive);
  const double along = static_cast<double>(place.segment) + static_cast<double>(u);
  return static_cast<float>(along / static_cast<double>(place.segment_count));
}

}  // namespace perfect_bvh
