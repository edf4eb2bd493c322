// An instance's motion within the shutter: its transforms at evenly spaced steps (math/turning.h describes the
// interpolation).
#pragma once

#include <vector>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/turning.h"

namespace perfect_bvh {

struct Turns {
  StepTimes times;
  std::vector<TurnStep> steps;  // two or more
  // From each step to the next, and at the last step. Made by finish().
  AlignedVector<TurnBack> backs;

  // Adds the next step's transform. Returns false, and adds nothing, if it flattens space: it then has no unique
  // rotation.
  [[nodiscard]] bool add(const Affine& transform);
  // Call after all steps have been added.
  void finish();
  [[nodiscard]] Affine at(float time) const noexcept;
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return steps.size() * sizeof(TurnStep) + backs.size() * sizeof(TurnBack);
  }
};

}  // namespace perfect_bvh
