// What work costs on a machine of round numbers, for decisions that are to be told in advance.
#pragma once

#include "update/calibration.h"

namespace perfect_bvh::test {

inline Calibration machine() {
  Calibration calibration;
  calibration.node_nanoseconds = 20, calibration.leaf_nanoseconds = 15, calibration.refit_nanoseconds = 10;
  calibration.rotate_nanoseconds = 15, calibration.rebuild_parts_nanoseconds = 60, calibration.rotation_gain = 0.4;
  calibration.fast = {150, 220}, calibration.binned = {600, 200}, calibration.spatial = {3000, 180};
  return calibration;
}

}  // namespace perfect_bvh::test
