// Twists the mesh about its longest axis in one step from rest. Measures the time of each method to update its tree,
// the rays per second through the result (ray_race.h; always on one thread), and the number of wrong hits.
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "refit_options.h"

namespace perfect_bvh::bench {

// Returns JSON objects: twist (radians), method, ns_per_triangle, cost (the governor's measure); primary_ratio and
// diffuse_ratio, the rays per second relative to a new tree of the same engine; rays_per_second_ratio, for both kinds
// together; `wrong` of `judged` answers; for our trees also `different`, the number of all rays whose answer is not bit
// for bit that of a new tree.
[[nodiscard]] std::vector<std::string> race_twist(const Mesh& rest, float radians, const RefitOptions& options);

}  // namespace perfect_bvh::bench
