// The eight boxes of a node against a ray: math/slab.h, eight at a time.
// Part of stream_kernel.inl: everything has internal linkage.

// `near`: where each box is entered.
struct NodeTest {
  Float8 near;
  Mask8 hit;
};

PERFECT_BVH_INLINE NodeTest test_node(const WideNode& node, const BoxState& box) noexcept {
  const Float8 inverse_x = broadcast(box.slab.inverse[0]);
  const Float8 inverse_y = broadcast(box.slab.inverse[1]);
  const Float8 inverse_z = broadcast(box.slab.inverse[2]);
  const Float8 near_x = fmsub(load_row(&node, box.rows.near_row[0]), inverse_x, broadcast(box.slab.near_offset[0]));
  const Float8 near_y = fmsub(load_row(&node, box.rows.near_row[1]), inverse_y, broadcast(box.slab.near_offset[1]));
  const Float8 near_z = fmsub(load_row(&node, box.rows.near_row[2]), inverse_z, broadcast(box.slab.near_offset[2]));
  const Float8 far_x = fmsub(load_row(&node, box.rows.far_row[0]), inverse_x, broadcast(box.slab.far_offset[0]));
  const Float8 far_y = fmsub(load_row(&node, box.rows.far_row[1]), inverse_y, broadcast(box.slab.far_offset[1]));
  const Float8 far_z = fmsub(load_row(&node, box.rows.far_row[2]), inverse_z, broadcast(box.slab.far_offset[2]));
  const Float8 near = max(max(near_x, near_y), max(near_z, broadcast(box.t_min)));
  const Float8 far = min(min(far_x, far_y), min(far_z, broadcast(box.t_limit)));
  return {near, less_equal(near, far)};
}
