// Compares trees byte for byte.
#pragma once

#include <cstring>

#include "builders/bvh2.h"
#include "core/aligned.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh::test {

template <class Row>
bool same_bytes(const AlignedVector<Row>& a, const AlignedVector<Row>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Row)) == 0);
}

inline bool same_bytes(const Bvh2& a, const Bvh2& b) {
  return same_bytes(a.nodes, b.nodes) && a.prim_indices == b.prim_indices && a.depth == b.depth;
}

inline bool same_bytes(const WideBvh& a, const WideBvh& b) {
  return same_bytes(a.nodes, b.nodes) && same_bytes(a.blocks, b.blocks) && same_bytes(a.curve_leaves, b.curve_leaves) &&
         same_bytes(a.point_leaves, b.point_leaves) && a.root == b.root && a.depth == b.depth && a.scale == b.scale &&
         a.is_empty == b.is_empty && std::memcmp(&a.extent, &b.extent, sizeof(TreeExtent)) == 0;
}

}  // namespace perfect_bvh::test
