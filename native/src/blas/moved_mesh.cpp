#include "blas/moved_mesh.h"

#include <algorithm>
#include <atomic>
#include <string>
#include <vector>

#include "blas/build_tree.h"
#include "core/errors.h"
#include "wide/wide_bvh.h"
#include "wide/wide_refit.h"

namespace perfect_bvh {
namespace {

// Returns the bounds of all steps, which are not empty.
Aabb bounds_of(const Blas& blas) noexcept {
  Aabb box = blas.box;
  for (const auto& step : blas.later) box.grow(step->box);
  return box;
}

// Returns the same primitives half-way between the first step and the last.
std::shared_ptr<const Mesh> middle_of(const Mesh& mesh) {
  const std::uint32_t step = mesh.times.last / 2;
  if (mesh.times.last % 2 == 0) return mesh.later[step - 1];
  auto middle = std::make_shared<Mesh>(mesh.at_step(step));
  middle->later.clear();
  const Mesh& next = *mesh.later[step];
  const auto go_half_way = [](Vec3f& at, Vec3f to) { at = at * 0.5f + to * 0.5f; };
  for (std::size_t i = 0; i < middle->positions.size(); ++i) go_half_way(middle->positions[i], next.positions[i]);
  for (std::size_t i = 0; i < middle->balls.size(); ++i) {
    Ball& ball = middle->balls[i];
    go_half_way(ball.centre, next.balls[i].centre);
    ball.radius = 0.5f * ball.radius + 0.5f * next.balls[i].radius;
  }
  return middle;
}

}  // namespace

void build_moving_tree(Blas& blas, MeshReport& report, ThreadPool& pool, CancelToken& cancel) {
  Blas middle(middle_of(blas.mesh));
  middle.config = blas.config;
  build_wide_tree(middle, report, pool, cancel);
  blas.config = middle.config;
  if (middle.wide.is_empty) {
    blas.wide = std::move(middle.wide);
    return;
  }
  complete_plan(blas.refit_plan, middle.wide, middle.mesh, pool, cancel);
  refit_wide(middle.wide, blas.refit_plan, blas.mesh, blas.wide, false, pool, cancel);
  blas.box = mesh_bounds_of(blas.wide, blas.mesh);
}

void add_motion_steps(Blas& blas, ThreadPool& pool, CancelToken& cancel) {
  if (!blas.mesh.moves() || blas.wide.is_empty) return;
  complete_plan(blas.refit_plan, blas.wide, blas.mesh, pool, cancel);
  blas.later.reserve(blas.mesh.later.size());
  for (const auto& mesh : blas.mesh.later) {
    auto step = std::make_shared<Blas>(mesh);
    refit_wide(blas.wide, blas.refit_plan, *mesh, step->wide, false, pool, cancel);
    step->box = mesh_bounds_of(step->wide, *mesh);
    blas.later.push_back(std::move(step));
  }
  const Aabb bounds = bounds_of(blas);
  const float scale = tree_scale(bounds);
  const float growth = with_kind(blas.mesh.kind, [](auto kind) { return kind.kMovingExtent; });
  const auto settle = [&](Blas& step) {
    if (step.wide.scale != scale)
      refit_wide(step.wide, blas.refit_plan, step.mesh, step.wide, true, pool, cancel, scale);
    step.wide.extent = tree_extent(bounds, scale * growth);
    step.round_leaves = view_leaves(step.wide, step.mesh);
  };
  settle(blas);
  blas.steps.push_back({blas.wide.nodes.data(), view_leaves(blas)});
  for (const auto& step : blas.later) {
    settle(*step);
    blas.steps.push_back({step->wide.nodes.data(), view_leaves(*step)});
  }
}

// Moved spheres -------------------------------------------------------------------------------------------------------

namespace {

constexpr std::size_t kGrain = 32768;  // positions or spheres that a task copies

void check_ball_count(std::size_t given, const Mesh& mesh, const char* function) {
  const std::size_t expected = given_ball_count(mesh);
  if (given == expected) return;
  const PrimitiveNames& names = names_of(mesh.kind);
  throw InvalidArgument(std::string(function) + ": " + names.vertices + " has " + std::to_string(given) +
                        " rows but there are " + std::to_string(expected) + " " + names.whose +
                        "; remove them and add the others");
}

// Returns the radii that the caller would pass to change nothing.
template <class T>
std::vector<T> given_radii(const Mesh& mesh) {
  std::vector<T> radii(given_ball_count(mesh), T{0});
  for (std::size_t i = 0; i < mesh.balls.size(); ++i) {
    radii[mesh.numbers.empty() ? i : mesh.numbers[i]] = static_cast<T>(mesh.balls[i].radius);
  }
  return radii;
}

bool has_radius(const Ball& ball) noexcept { return ball.radius > 0; }

// Returns whether a point that was omitted has a radius now.
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
  Mesh remade = make_again(mesh, balls, function);
  const bool is_same =
      std::ranges::equal(remade.segments, mesh.segments) && std::ranges::equal(remade.numbers, mesh.numbers);
  return {std::make_shared<const Mesh>(std::move(remade)), is_same};
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
                        ": radii that are 0 at one step must be 0 at every step, because a "
                        "primitive without a radius is left out; give the others a small radius");
}
template std::shared_ptr<const Mesh> balls_at_step(const Mesh&, const BallsGiven<float>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> balls_at_step(const Mesh&, const BallsGiven<double>&, ThreadPool&, const char*);

template MovedBalls move_balls(const Mesh&, const BallsGiven<float>&, const std::shared_ptr<SparePositions>&,
                               ThreadPool&, const char*);
template MovedBalls move_balls(const Mesh&, const BallsGiven<double>&, const std::shared_ptr<SparePositions>&,
                               ThreadPool&, const char*);

// Moved mesh ----------------------------------------------------------------------------------------------------------

namespace {

// The vertices that a task copies: after the check, they are still in a second level cache.

void copy(std::span<const Vec3f> positions, Mesh& mesh, ThreadPool& pool, const char* function) {
  std::atomic<bool> all_good{true};
  parallel_for(pool, positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    const auto chunk = positions.subspan(begin, end - begin);
    if (!are_good(chunk)) all_good = false;
    std::copy(chunk.begin(), chunk.end(), &mesh.positions[begin]);
  });
  if (!all_good) check_positions(positions, function);
}

// Positions are relative to mesh.centre.
void copy(std::span<const Vec3d> positions, Mesh& mesh, ThreadPool& pool, const char* function) {
  check_positions(positions, function);
  parallel_for(pool, positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    narrow(positions.subspan(begin, end - begin), mesh.centre, &mesh.positions[begin]);
  });
}

}  // namespace

std::shared_ptr<const Mesh> lend_mesh(Mesh mesh, const std::shared_ptr<SparePositions>& spare) {
  auto owned = std::make_unique<Mesh>(std::move(mesh));
  const auto give_back = [spare](Mesh* done) noexcept {
    spare->give({std::move(done->positions), std::move(done->balls)});
    delete done;
  };
  return std::shared_ptr<Mesh>(owned.release(), give_back);  // if it throws, it calls the deleter first
}

template <class T>
std::shared_ptr<const Mesh> move_vertices(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                          const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                          const char* function) {
  check_count(positions.size(), mesh.positions.size(), function);
  Mesh moved;
  moved.triangles = mesh.triangles;
  moved.positions = spare->take().positions;
  moved.positions.resize(positions.size());
  if constexpr (sizeof(T) == sizeof(double)) moved.centre = box_centre(positions);
  copy(positions, moved, pool, function);
  return lend_mesh(std::move(moved), spare);
}

template <class T>
std::shared_ptr<const Mesh> move_in_steps(const Mesh& mesh, std::span<const Vec3<T>> positions, const StepTimes& times,
                                          const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                          const char* function) {
  const std::size_t count = mesh.positions.size();
  check_count(positions.size() / (times.last + std::size_t{1}), count, function);
  Mesh moved;
  moved.triangles = mesh.triangles;
  moved.times = times;
  if constexpr (sizeof(T) == sizeof(double)) moved.centre = box_centre(positions);
  for (std::uint32_t step = 1; step <= times.last; ++step) {
    auto later = std::make_shared<Mesh>();
    later->triangles = mesh.triangles, later->centre = moved.centre;
    later->positions.resize(count);
    copy(positions.subspan(step * count, count), *later, pool, function);
    moved.later.push_back(std::move(later));
  }
  moved.positions = spare->take().positions;
  moved.positions.resize(count);
  copy(positions.first(count), moved, pool, function);
  return lend_mesh(std::move(moved), spare);
}
template std::shared_ptr<const Mesh> move_in_steps(const Mesh&, std::span<const Vec3f>, const StepTimes&,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> move_in_steps(const Mesh&, std::span<const Vec3d>, const StepTimes&,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);

template std::shared_ptr<const Mesh> move_vertices(const Mesh&, std::span<const Vec3f>,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> move_vertices(const Mesh&, std::span<const Vec3d>,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);

}  // namespace perfect_bvh
