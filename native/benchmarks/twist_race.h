// The mesh twisted about its longest axis in one step from rest: what each way of bringing its tree there takes, the
// rays per second through what it leaves (ray_race.h; always on one thread), and how many hits are wrong.
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "refit_options.h"

namespace perfect_bvh::bench {

// JSON objects: twist (radians), method, ns_per_triangle, cost (as the governor sees it);
// primary_ratio and diffuse_ratio, the rays per second over those through a new tree of the same side, and
// rays_per_second_ratio, of both kinds together; wrong of `judged` answers; of ours also `different`, of all rays those
// not answered as a new tree does, bit by bit.
[[nodiscard]] std::vector<std::string> race_twist(const Mesh& rest, float radians, const RefitOptions& options);

}  // namespace perfect_bvh::bench
