// What kernels see of what moves within the shutter: plain structs, as in scene_view.h.
#pragma once

#include "math/step_times.h"
#include "math/turning.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {

struct IndexedLeaves;

// A tree at one step: all steps of a tree have the same nodes and leaves, with the boxes and vertices of their time.
struct TreeStep {
  const WideNode* nodes;
  union {
    const LeafBlock* blocks;  // as in an InstanceView
    const IndexedLeaves* indexed_leaves;
  };
};

// Of an instance that moves: itself, its mesh, or both.
struct MotionView {
  const TreeStep* trees = nullptr;  // null: the mesh keeps its shape
  const TurnStep* turns = nullptr;  // null: the instance stays where it is
  StepTimes tree_times, turn_times;
  double centre[3] = {0, 0, 0};  // where the tree's frame has its origin in the mesh's own, which is what turns
};

}  // namespace perfect_bvh
