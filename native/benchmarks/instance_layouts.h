// Where benchmarks place their instances.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "math/aabb.h"

namespace perfect_bvh::bench {

// `grid`: a cubic grid with jitter, neighbours hardly overlap. `heap`: the same grid drawn together to a quarter of its
// width, so that each instance stands in dozens of others. Each is turned at random and 0.7 to 1.3 times as large. The
// mesh is given by its box; different seeds move every instance.
[[nodiscard]] std::vector<Affine> place_instances(const std::string& layout, const Aabb& mesh, std::size_t count,
                                                  unsigned seed);

}  // namespace perfect_bvh::bench
