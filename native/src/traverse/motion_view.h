// What kernels see of what moves within the shutter: plain structs, as in scene_view.h.
#pragma once

#include <cstddef>

#include "math/step_times.h"
#include "math/turn_back.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct RoundLeaves;

// A tree at one step: all steps of a tree have the same nodes and leaves, with the boxes and vertices of their time.
struct TreeStep {
  const WideNode* nodes;
  union {
    const LeafBlock* blocks;  // as in an InstanceView
    const RoundLeaves* round_leaves;
  };
};

// Of an instance that moves: itself, its mesh, or both. What rays read of it is one line of the cache.
struct alignas(64) MotionView {
  const TreeStep* trees = nullptr;  // null: the mesh keeps its shape
  const TurnBack* backs = nullptr;  // null: the instance stays where it is
  StepTimes tree_times, turn_times;
  double centre[3] = {0, 0, 0};     // where the tree's frame has its origin in the mesh's own, which is what turns
  const TurnStep* turns = nullptr;  // null with `backs`
};
static_assert(offsetof(MotionView, turns) == 64);

}  // namespace perfect_bvh
