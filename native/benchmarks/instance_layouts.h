// Where benchmarks place their instances.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "math/aabb.h"

namespace perfect_bvh::bench {

// `grid`: a cubic grid with jitter, whose neighbours hardly overlap. `heap`: the same grid shrunk to a quarter of its
// width, so that each instance overlaps dozens of others. Each instance is turned at random and scaled by 0.7 to 1.3.
// The mesh is given by its box; a different seed moves every instance.
[[nodiscard]] std::vector<Affine> place_instances(const std::string& layout, const Aabb& mesh, std::size_t count,
                                                  unsigned seed);

}  // namespace perfect_bvh::bench
