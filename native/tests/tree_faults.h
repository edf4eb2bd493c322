// Checks whether trees are sound, by walking them without assumptions.
#pragma once

#include <cstddef>
#include <string>

#include "builders/bvh2.h"
#include "mesh/mesh.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh::test {

// Returns an empty string if the tree is sound: every primitive below primitive_count reachable, children inside their
// parents, parents first, siblings adjacent, no node reached twice, depth as stored. Otherwise a sentence that names
// the first fault.
[[nodiscard]] std::string find_fault(const Bvh2& tree, std::size_t primitive_count);

// Returns an empty string if the tree is sound: every triangle in some leaf (in exactly one if `once`), every vertex as
// in the mesh, boxes inside their parents' and around their content, no node or leaf reached twice or not at all, every
// order a permutation, depth as stored. Otherwise a sentence that names the first fault.
[[nodiscard]] std::string find_wide_fault(const WideBvh& tree, const Mesh& mesh, bool once);

}  // namespace perfect_bvh::test
