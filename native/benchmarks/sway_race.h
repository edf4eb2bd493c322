// What it costs to follow a mesh that sways: every competitor in turn, the order rotating from round to round, each
// from the frame's positions in memory to a scene ready to trace. With one thread the time is the thread's own CPU
// time, otherwise that of the wall clock.
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "refit_options.h"

namespace perfect_bvh::bench {

// JSON objects: method, ns_per_triangle (the median), ns_low, ns_high; of commits also what the scene did, by how
// often.
[[nodiscard]] std::vector<std::string> race_sway(const Mesh& mesh, const RefitOptions& options);

}  // namespace perfect_bvh::bench
