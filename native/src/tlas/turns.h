// How an instance moves within the shutter: its transforms at evenly spaced steps (math/turning.h says what is
// between).
#pragma once

#include <vector>

#include "math/affine.h"
#include "math/turning.h"

namespace perfect_bvh {

struct Turns {
  StepTimes times;
  std::vector<TurnStep> steps;  // two or more

  // The next step's transform. False, and nothing added, if it flattens space: no rotation is to be found in it then.
  [[nodiscard]] bool add(const Affine& transform);
  [[nodiscard]] Affine at(float time) const noexcept;
};

}  // namespace perfect_bvh
