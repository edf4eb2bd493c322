// What work costs on a machine of round numbers, for decisions that are to be told in advance.
#pragma once

#include <optional>

#include "scene/scene.h"
#include "update/governor.h"

namespace perfect_bvh::test {

inline Calibration machine() {
  Calibration calibration;
  calibration.node_nanoseconds = 20, calibration.leaf_nanoseconds = 15, calibration.refit_nanoseconds = 10;
  calibration.rotate_nanoseconds = 15, calibration.rebuild_parts_nanoseconds = 60, calibration.rotation_gain = 0.4;
  calibration.fast = {150, 220}, calibration.binned = {600, 200}, calibration.spatial = {3000, 180};
  return calibration;
}

// Of a commit on that machine, which is told how many rays will follow, or nothing.
inline CommitOptions on_machine(std::optional<double> expected_rays, Policy policy = Policy::kGoverned) {
  CommitOptions options;
  options.policy = policy;
  options.expected_rays = expected_rays;
  options.calibration = machine();
  return options;
}

}  // namespace perfect_bvh::test
