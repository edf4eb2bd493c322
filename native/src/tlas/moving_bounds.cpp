#include "tlas/moving_bounds.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "blas/world_box.h"
#include "core/cancel.h"

namespace perfect_bvh {
namespace {

constexpr int kMostParts = 64;  // of an interval, at whose borders boxes are computed

Vec3d corner(const Aabb& box, int i) noexcept {
  return to_double(
      Vec3f{i & 1 ? box.upper.x : box.lower.x, i & 2 ? box.upper.y : box.lower.y, i & 4 ? box.upper.z : box.lower.z});
}

const Aabb& box_of_step(const Blas& blas, std::uint32_t step) noexcept {
  return step == 0 ? blas.box : blas.later[step - 1]->box;
}

void add_steps(const StepTimes& times, std::vector<double>& list) {
  for (std::uint32_t step = 0; step <= times.last; ++step) {
    const double time = time_of(times, step);
    if (time > 0.0 && time < 1.0) list.push_back(time);
  }
}

double size_of(const double stretch[9]) noexcept {
  double square = 0;
  for (int i = 0; i < 9; ++i) square += stretch[i] * stretch[i];
  return std::sqrt(square);
}

double largest(Vec3d v) noexcept { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

MovingBounds::MovingBounds(const Instance& instance) : instance_(instance) {
  const Blas& blas = *instance.blas;
  const Vec3d centre = blas.mesh.centre;
  const bool deforms = !blas.later.empty();
  if (!deforms && instance.turns != nullptr && !blas.wide.is_empty) {
    support_ = &blas.support.of(blas.wide, blas.mesh);
  }
  if (deforms) add_steps(blas.mesh.times, corners_);
  if (instance.turns != nullptr) add_steps(instance.turns->times, corners_);
  std::sort(corners_.begin(), corners_.end());
  for (std::uint32_t step = 0; step <= blas.later.size(); ++step) {
    for (int i = 0; i < 8; ++i) {
      const Vec3d here = corner(box_of_step(blas, step), i);
      farthest_ = std::max(farthest_, length(centre + here));
      if (step == blas.later.size()) continue;
      const Vec3d next = corner(box_of_step(blas, step + 1), i);
      fastest_ = std::max(fastest_, length(next - here) * static_cast<double>(blas.mesh.times.rate));
    }
  }
}

MovingBounds::Box MovingBounds::at(double time) const {
  const Affine place = place_at(instance_, static_cast<float>(time));
  const Aabb box = support_ != nullptr ? transformed_bounds(*support_, reach_of(instance_.blas->box), place)
                                       : transformed_bounds(mesh_box_at(time), place);
  return {to_double(box.lower), to_double(box.upper)};
}

Aabb MovingBounds::mesh_box_at(double time) const {
  const Blas& blas = *instance_.blas;
  if (blas.later.empty()) return blas.box;
  const Moment moment = moment_at(blas.mesh.times, static_cast<float>(time));
  const Aabb& from = box_of_step(blas, moment.step);
  if (!moment.is_between()) return from;
  const Aabb& to = box_of_step(blas, moment.step + 1);
  Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = interpolate(moment, from.lower[axis], to.lower[axis]);
    box.upper[axis] = interpolate(moment, from.upper[axis], to.upper[axis]);
  }
  return box;
}

double MovingBounds::bend(double begin, double end) const {
  if (instance_.turns == nullptr) return 0.0;
  const Turns& turns = *instance_.turns;
  const double rate = turns.times.rate;
  const auto step_at = [&](double time) {
    return std::clamp((time - static_cast<double>(turns.times.begin)) * rate, 0.0,
                      static_cast<double>(turns.times.last));
  };
  const auto first = static_cast<std::uint32_t>(std::floor(step_at(begin)));
  const auto last = static_cast<std::uint32_t>(std::ceil(step_at(end)));
  double most = 0;
  for (std::uint32_t step = first; step < last; ++step) {
    const TurnStep &from = turns.steps[step], &to = turns.steps[step + 1];
    double change[9];
    for (int i = 0; i < 9; ++i) change[i] = to.stretch[i] - from.stretch[i];
    const double w = 2.0 * from.angle * rate, growth = size_of(change) * rate;
    const double size = std::max(size_of(from.stretch), size_of(to.stretch));
    most = std::max(
        most, w * w * size * farthest_ + 2.0 * w * (growth * farthest_ + size * fastest_) + 2.0 * growth * fastest_);
  }
  return most;
}

std::uint32_t MovingBounds::wanted_intervals() const {
  const Box box = at(0.5);
  const double size = length(box.upper - box.lower);
  const double turns = size > 0 ? std::sqrt(bend(0.0, 1.0) / (0.8 * size)) : 1.0;
  const double steps = static_cast<double>(corners_.size()) + 1.0;
  return static_cast<std::uint32_t>(std::clamp(std::ceil(std::max(turns, steps)), 1.0, double{kMostTopSteps}));
}

// Widens both boxes by the same amount on each side, as far as needed.
void MovingBounds::widen(double begin, double end, Box& first, Box& last) const {
  std::vector<double> times{begin};
  for (const double time : corners_) {
    if (time > begin && time < end) times.push_back(time);
  }
  times.push_back(end);
  const Box from = first, to = last;
  Vec3d below{0, 0, 0}, above{0, 0, 0};
  const auto look_at = [&](double time, double sag) {
    const Box box = at(time);
    const double later = (time - begin) / (end - begin);
    const Vec3d by{sag, sag, sag};
    below = max(below, from.lower * (1.0 - later) + to.lower * later - (box.lower - by));
    above = max(above, box.upper + by - (from.upper * (1.0 - later) + to.upper * later));
  };
  for (std::size_t i = 0; i + 1 < times.size(); ++i) {
    const double span = times[i + 1] - times[i], curve = bend(times[i], times[i + 1]);
    const double size = length(to.upper - to.lower);
    const double wanted = size > 0 ? std::ceil(span * std::sqrt(curve / (0.08 * size))) : 1.0;
    const int parts = static_cast<int>(std::clamp(wanted, 1.0, double{kMostParts}));
    const double step = span / parts, sag = step * step * curve / 8.0;
    for (int part = 0; part <= parts; ++part) look_at(times[i] + part * step, sag);
  }
  first.lower = first.lower - below, first.upper = first.upper + above;
  last.lower = last.lower - below, last.upper = last.upper + above;
}

void MovingBounds::fill(std::span<Aabb> boxes) const {
  const auto intervals = static_cast<double>(boxes.size() - 1);
  std::vector<Box> exact(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) exact[i] = at(static_cast<double>(i) / intervals);
  std::vector<Box> wide = exact;
  for (std::size_t i = 0; i + 1 < boxes.size(); ++i) {
    Box first = exact[i], last = exact[i + 1];
    widen(static_cast<double>(i) / intervals, static_cast<double>(i + 1) / intervals, first, last);
    for (const auto& [place, box] : {std::pair(i, first), std::pair(i + 1, last)}) {
      wide[place].lower = min(wide[place].lower, box.lower), wide[place].upper = max(wide[place].upper, box.upper);
    }
  }
  double most = 0;
  for (const Box& box : wide) most = std::max({most, largest(box.lower), largest(box.upper)});
  const double rounding = 0x1p-20 * most;  // of times and of boxes when they are interpolated in float
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      boxes[i].lower[axis] = round_down(wide[i].lower[axis] - rounding);
      boxes[i].upper[axis] = round_up(wide[i].upper[axis] + rounding);
    }
  }
}

// Motions -------------------------------------------------------------------------------------------------------------

namespace {

constexpr std::size_t kGrain = 64;  // instances bounded by one task

MotionView view_of_motion(const Instance& instance) {
  MotionView view;
  const Blas& blas = *instance.blas;
  if (!blas.steps.empty()) view.trees = blas.steps.data(), view.tree_times = blas.mesh.times;
  if (instance.turns != nullptr) {
    view.turns = instance.turns->steps.data(), view.backs = instance.turns->backs.data();
    view.turn_times = instance.turns->times;
  }
  const Vec3d centre = blas.mesh.centre;
  view.centre[0] = centre.x, view.centre[1] = centre.y, view.centre[2] = centre.z;
  return view;
}

// Lists the rows of instances that move.
std::vector<std::uint32_t> list_moving(Snapshot& snapshot, CancelToken& cancel) {
  std::vector<std::uint32_t> rows;
  for_steps(snapshot.instances.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      Instance& instance = snapshot.instances[row];
      if (instance.blas->box.is_empty() || (instance.turns == nullptr && instance.blas->steps.empty())) continue;
      rows.push_back(static_cast<std::uint32_t>(row));
      snapshot.motions.push_back(view_of_motion(instance));
      instance.motion = static_cast<std::uint32_t>(rows.size());
      snapshot.instance_views[row].motion = instance.motion;
    }
  });
  return rows;
}

std::uint32_t interval_count(const Snapshot& snapshot, std::span<const std::uint32_t> rows, ThreadPool& pool,
                             CancelToken& cancel) {
  std::atomic<std::uint32_t> most{1};
  for_chunks(pool, rows.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    std::uint32_t wanted = 1;
    for (std::size_t i = begin; i < end; ++i) {
      wanted = std::max(wanted, MovingBounds(snapshot.instances[rows[i]]).wanted_intervals());
    }
    std::uint32_t held = most;
    while (held < wanted && !most.compare_exchange_weak(held, wanted)) continue;
  });
  return most;
}

// Compares the boxes around the whole motion. If the larger part of a scene does not move, packets of rays pay off.
bool are_mostly_still(const Snapshot& snapshot, std::span<const PrimRef> boxes, CancelToken& cancel) {
  double still = 0, moving = 0;
  for_steps(boxes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const Aabb box = boxes[row].box();
      if (!box.is_empty()) (snapshot.instances[row].motion != 0 ? moving : still) += half_area(box);
    }
  });
  return still > moving;
}

}  // namespace

StepBoxes add_motions(Snapshot& snapshot, std::span<PrimRef> boxes, ThreadPool& pool, CancelToken& cancel) {
  snapshot.motions.clear();
  const auto moves = [](const auto& blas) { return !blas->steps.empty(); };
  if (snapshot.turns.empty() && std::none_of(snapshot.blases.begin(), snapshot.blases.end(), moves)) return {};
  const std::vector<std::uint32_t> rows = list_moving(snapshot, cancel);
  if (rows.empty()) return {};
  const std::size_t count = std::size_t{interval_count(snapshot, rows, pool, cancel)} + 1;
  StepBoxes steps(count);
  for (auto& step : steps) step.assign(boxes.begin(), boxes.end());
  for_chunks(pool, rows.size(), kGrain, cancel, [&](std::size_t begin, std::size_t end) {
    std::vector<Aabb> own(count);
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t row = rows[i];
      MovingBounds(snapshot.instances[row]).fill(own);
      Aabb all;
      for (std::size_t step = 0; step < count; ++step) {
        steps[step][row].lower = own[step].lower, steps[step][row].upper = own[step].upper;
        all.grow(own[step]);
      }
      boxes[row].lower = all.lower, boxes[row].upper = all.upper;
    }
  });
  for (const std::uint32_t row : rows) snapshot.bounds.grow(boxes[row].box());
  snapshot.is_mostly_still = are_mostly_still(snapshot, boxes, cancel);
  return steps;
}

}  // namespace perfect_bvh
