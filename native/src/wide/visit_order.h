// In which order a ray visits the children of a wide node.
#pragma once

#include <cstdint>

#include "wide/wide_bvh.h"

namespace perfect_bvh {

// Fills in `order` of a node whose first `count` places are taken: the child whose box stands farthest along the
// diagonal of a ray's octant comes first, since what is pushed last is visited first. For four octants; the opposite
// ones see the reverse.
void set_visit_order(WideNode& node, std::uint32_t count) noexcept;

}  // namespace perfect_bvh
