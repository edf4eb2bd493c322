// How an instance moves within the shutter: its transforms at evenly spaced steps (math/turning.h says what is
// between).
#pragma once

#include <vector>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/turning.h"

namespace perfect_bvh {

struct Turns {
  StepTimes times;
  std::vector<TurnStep> steps;  // two or more
  // From each step to the next, and at the last: made by finish().
  AlignedVector<TurnBack> backs;

  // The next step's transform. False, and nothing added, if it flattens space: no rotation is to be found in it then.
  [[nodiscard]] bool add(const Affine& transform);
  // All steps are there.
  void finish();
  [[nodiscard]] Affine at(float time) const noexcept;
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return steps.size() * sizeof(TurnStep) + backs.size() * sizeof(TurnBack);
  }
};

}  // namespace perfect_bvh
