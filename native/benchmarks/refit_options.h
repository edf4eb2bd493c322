// The options of refit_bench.
#pragma once

#include <string>
#include <vector>

#include "arguments.h"

namespace perfect_bvh::bench {

struct RefitOptions : CommonOptions {
  RefitOptions() { rounds = 9; }

  int threads = 1, ray_rounds = 5;
  std::vector<float> twists{0.1f, 1.5f, 6.2831853f};
  std::string mesh;
};

}  // namespace perfect_bvh::bench
