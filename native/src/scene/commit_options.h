// What whoever commits knows of the time to come, and what the machine is like.
#pragma once

#include <optional>

#include "update/calibration.h"
#include "update/governor.h"

namespace perfect_bvh {

struct CommitOptions {
  Policy policy = Policy::kGoverned;
  std::optional<double> expected_rays;  // about to be cast at the scene; unknown: trees are chosen without
  Calibration calibration;
};

}  // namespace perfect_bvh
