// The eight boxes of a node against a ray: math/slab.h, eight at a time.
// Part of stream_kernel.inl: everything has internal linkage.

// `near`: where each box is entered.
struct NodeTest {
  Float8 near;
  Mask8 hit;
};

PERFECT_BVH_INLINE NodeTest test_node(const WideNode& node, const BoxState& box) noexcept {
  const float *const inverse = box.slab.inverse, *const near_offset = box.slab.near_offset;
  const float* const far_offset = box.slab.far_offset;
  const Float8 near_x = plane_depths<0>(load_row(&node, box.rows.near_row[0]), inverse, near_offset);
  const Float8 near_y = plane_depths<1>(load_row(&node, box.rows.near_row[1]), inverse, near_offset);
  const Float8 near_z = plane_depths<2>(load_row(&node, box.rows.near_row[2]), inverse, near_offset);
  const Float8 far_x = plane_depths<0>(load_row(&node, box.rows.far_row[0]), inverse, far_offset);
  const Float8 far_y = plane_depths<1>(load_row(&node, box.rows.far_row[1]), inverse, far_offset);
  const Float8 far_z = plane_depths<2>(load_row(&node, box.rows.far_row[2]), inverse, far_offset);
  const Float8 near = max(max(near_x, near_y), max(near_z, broadcast(box.t_min)));
  const Float8 far = min(min(far_x, far_y), min(far_z, broadcast(box.t_limit)));
  return {near, less_equal(near, far)};
}
