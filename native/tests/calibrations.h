// The costs of a machine with round numbers, for decisions that tests predict.
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

// Commit options on that machine, with the number of expected rays, or none.
inline CommitOptions on_machine(std::optional<double> expected_rays, Policy policy = Policy::kGoverned) {
  CommitOptions options;
  options.policy = policy;
  options.expected_rays = expected_rays;
  options.calibration = machine();
  return options;
}

}  // namespace perfect_bvh::test
