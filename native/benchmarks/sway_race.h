// Measures the cost of following a mesh that sways. Competitors take turns, and the order rotates from round to round.
// Each starts with the frame's positions in memory and ends with a scene ready to trace. With one thread the time is
// the thread's own CPU time, otherwise wall-clock time.
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "refit_options.h"

namespace perfect_bvh::bench {

// Returns JSON objects: method, ns_per_triangle (the median), ns_low, ns_high; for commits also how often the scene
// took each action.
[[nodiscard]] std::vector<std::string> race_sway(const Mesh& mesh, const RefitOptions& options);

}  // namespace perfect_bvh::bench
