#include "tlas/motions.h"

#include <algorithm>
#include <atomic>

#include "core/steps.h"
#include "tlas/moving_bounds.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kGrain = 64;  // instances that a task bounds

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

// The rows of instances that move, as they are told to.
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

// Of the boxes of all ways; where the larger part of a scene stands still, packets of rays pay.
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
