// The nodes and leaves of a tree between two of its steps: boxes and vertices in straight lines (math/step_times.h).
// Part of stream_kernel.inl: everything has internal linkage.

// test_node() of the boxes at a moment.
PERFECT_BVH_INLINE NodeTest test_moving_node(const WideNode& node, const WideNode& later, const BoxState& box,
                                             const Moment& moment) noexcept {
  const Shares shares(moment);
  const auto row = [&](std::size_t offset) __attribute__((always_inline)) {
    return interpolate(shares, load_row(&node, offset), load_row(&later, offset));
  };
  const float *const inverse = box.slab.inverse, *const near_offset = box.slab.near_offset;
  const float* const far_offset = box.slab.far_offset;
  const Float8 near_x = plane_depths<0>(row(box.rows.near_row[0]), inverse, near_offset);
  const Float8 near_y = plane_depths<1>(row(box.rows.near_row[1]), inverse, near_offset);
  const Float8 near_z = plane_depths<2>(row(box.rows.near_row[2]), inverse, near_offset);
  const Float8 far_x = plane_depths<0>(row(box.rows.far_row[0]), inverse, far_offset);
  const Float8 far_y = plane_depths<1>(row(box.rows.far_row[1]), inverse, far_offset);
  const Float8 far_z = plane_depths<2>(row(box.rows.far_row[2]), inverse, far_offset);
  const Float8 near = max(max(near_x, near_y), max(near_z, broadcast(box.t_min)));
  const Float8 far = min(min(far_x, far_y), min(far_z, broadcast(box.t_limit)));
  return {near, less_equal(near, far)};
}

PERFECT_BVH_INLINE NodeTest test_any_node(const Slot& slot, std::uint32_t row) noexcept {
  if (slot.later_nodes == nullptr) return test_node(slot.nodes[row], slot.box);
  return test_moving_node(slot.nodes[row], slot.later_nodes[row], slot.box, slot.moment);
}

// The node that a tree of that moment would have.
inline WideNode node_between(const WideNode& from, const WideNode& to, const Moment& moment) noexcept {
  WideNode node = from;
  const Shares shares(moment);
  for (int i = 0; i < 6; ++i) {
    store(node.planes[i], interpolate(shares, load(from.planes[i]), load(to.planes[i])));
  }
  return node;
}

// The leaf that a tree of that moment would have, between those of two steps: its vertices are interpolated when they
// are read. Its bound of the triangles' spans is larger: vertices are rounded where they are interpolated, by a part of
// how far away from the origin they are, which `reach` bounds.
struct MovingBlock {
  const LeafBlock &from, &to;
  const Moment& moment;
  const std::uint32_t* primitives;
  float span;

  PERFECT_BVH_INLINE MovingBlock(const TreeStep* step, const Moment& at, std::uint32_t row, float slack) noexcept
      : from(step[0].blocks[row]), to(step[1].blocks[row]), moment(at), primitives(from.primitives) {
    span = 0.0f;  // of a leaf that is a point it is no number
    if (span_bound(from) > span) span = span_bound(from);
    if (span_bound(to) > span) span = span_bound(to);
    span = span * (1.0f + 0x1p-10f) + slack;
  }
};

PERFECT_BVH_INLINE ShearedCorners shear(const MovingBlock& block, const TriangleState& triangle) noexcept {
  const Shares shares(block.moment);
  const auto row = [&](int i) __attribute__((always_inline)) {
    return interpolate(shares, load_row(block.from.vertices, triangle.row[i]),
                       load_row(block.to.vertices, triangle.row[i]));
  };
  return shear_vertices(row, block.from.corners, triangle);
}
PERFECT_BVH_INLINE float span_bound(const MovingBlock& block) noexcept { return block.span; }
inline float coordinate(const MovingBlock& block, int lane, int corner, int axis) noexcept {
  return interpolate(block.moment, coordinate(block.from, lane, corner, axis),
                     coordinate(block.to, lane, corner, axis));
}

// Curves or points at a moment: those of a step, with the next step's balls.
PERFECT_BVH_INLINE RoundLeaves moving_leaves(const TreeStep* step, const Moment& moment) noexcept {
  RoundLeaves leaves = *step[0].round_leaves;
  if (moment.is_between()) leaves.round.later = step[1].round_leaves->round.balls, leaves.round.moment = moment;
  return leaves;
}
