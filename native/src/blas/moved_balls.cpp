#include "blas/moved_balls.h"

#include <algorithm>
#include <atomic>
#include <string>
#include <vector>

#include "blas/moved_mesh.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 32768;  // balls that a task copies

void check_ball_count(std::size_t given, const Mesh& mesh, const char* function) {
  const std::size_t expected = given_ball_count(mesh);
  if (given == expected) return;
  const bool is_points = mesh.kind == PrimitiveKind::kPoints;
  throw InvalidArgument(std::string(function) + ": " + name_of_centres(mesh.kind) + " has " + std::to_string(given) +
                        " rows but there are " + std::to_string(expected) + (is_points ? " points" : " in all curves") +
                        "; remove them and add the others");
}

// The radii that the caller would give to leave all as it is.
template <class T>
std::vector<T> given_radii(const Mesh& mesh) {
  std::vector<T> radii(given_ball_count(mesh), T{0});
  for (std::size_t i = 0; i < mesh.balls.size(); ++i) {
    radii[mesh.numbers.empty() ? i : mesh.numbers[i]] = static_cast<T>(mesh.balls[i].radius);
  }
  return radii;
}

bool has_radius(const Ball& ball) noexcept { return ball.radius > 0; }

// Whether a point that was left out has a radius now.
template <class T>
bool gained_radius(const Mesh& mesh, const BallsGiven<T>& balls) noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; !mesh.numbers.empty() && i < balls.centres.size(); ++i) {
    if (mesh.numbers[kept] == i) {
      ++kept;
    } else if (has_radius(ball_at(balls, i, {0, 0, 0}))) {
      return true;
    }
  }
  return false;
}

template <class T>
Mesh made_again(const Mesh& mesh, const BallsGiven<T>& balls, const char* function) {
  if (mesh.kind == PrimitiveKind::kPoints) return make_points(balls, function);
  const std::vector<std::int64_t> offsets(mesh.starts.begin(), mesh.starts.end());
  return make_curves(balls, offsets, mesh.shape, function, mesh.cyclic_curves());
}

}  // namespace

template <class T>
MovedBalls move_balls(const Mesh& mesh, const BallsGiven<T>& given, const std::shared_ptr<SparePositions>& spare,
                      ThreadPool& pool, const char* function) {
  check_ball_count(given.centres.size(), mesh, function);
  const std::vector<T> kept = given.radii.empty() ? given_radii<T>(mesh) : std::vector<T>();
  const BallsGiven<T> balls{given.centres, given.radii.empty() ? std::span<const T>(kept) : given.radii};
  check_balls(balls, mesh.kind, function);
  Mesh moved;
  moved.share_parts_of(mesh);
  if constexpr (sizeof(T) == sizeof(double)) moved.centre = box_centre(balls.centres);
  moved.balls = spare->take().balls;
  moved.balls.resize(mesh.balls.size());
  std::atomic<bool> all_alike{true};
  const auto number_of = [&](std::size_t i) { return mesh.numbers.empty() ? i : std::size_t{mesh.numbers[i]}; };
  parallel_for(pool, moved.balls.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    bool is_alike = true;
    for (std::size_t i = begin; i < end; ++i) {
      moved.balls[i] = ball_at(balls, number_of(i), moved.centre);
      is_alike &= has_radius(moved.balls[i]) == has_radius(mesh.balls[i]);
    }
    if (!is_alike) all_alike = false;
  });
  if (all_alike && !gained_radius(mesh, balls)) return {lend_mesh(std::move(moved), spare), true};
  Mesh anew = made_again(mesh, balls, function);
  const bool is_same =
      std::ranges::equal(anew.segments, mesh.segments) && std::ranges::equal(anew.numbers, mesh.numbers);
  return {std::make_shared<const Mesh>(std::move(anew)), is_same && mesh.kind == PrimitiveKind::kCurves};
}
template <class T>
std::shared_ptr<const Mesh> balls_at_step(const Mesh& first, const BallsGiven<T>& given, ThreadPool& pool,
                                          const char* function) {
  check_ball_count(given.centres.size(), first, function);
  const std::vector<T> kept = given.radii.empty() ? given_radii<T>(first) : std::vector<T>();
  const BallsGiven<T> balls{given.centres, given.radii.empty() ? std::span<const T>(kept) : given.radii};
  check_balls(balls, first.kind, function);
  auto step = std::make_shared<Mesh>();
  step->share_parts_of(first);
  step->centre = first.centre;
  step->balls.resize(first.balls.size());
  std::atomic<bool> all_alike{!gained_radius(first, balls)};
  parallel_for(pool, step->balls.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      step->balls[i] = ball_at(balls, first.numbers.empty() ? i : std::size_t{first.numbers[i]}, first.centre);
      if (has_radius(step->balls[i]) != has_radius(first.balls[i])) all_alike = false;
    }
  });
  if (all_alike) return step;
  throw InvalidArgument(std::string(function) +
                        ": radii that are 0 at one step must be 0 at every step, since what has "
                        "none is left out; give the others a small one");
}
template std::shared_ptr<const Mesh> balls_at_step(const Mesh&, const BallsGiven<float>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> balls_at_step(const Mesh&, const BallsGiven<double>&, ThreadPool&, const char*);

template MovedBalls move_balls(const Mesh&, const BallsGiven<float>&, const std::shared_ptr<SparePositions>&,
                               ThreadPool&, const char*);
template MovedBalls move_balls(const Mesh&, const BallsGiven<double>&, const std::shared_ptr<SparePositions>&,
                               ThreadPool&, const char*);

}  // namespace perfect_bvh
