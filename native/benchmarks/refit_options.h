// What refit_bench is asked to measure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "builders/build_config.h"

namespace perfect_bvh::bench {

struct RefitOptions {
  int threads = 1, rounds = 9, ray_rounds = 5;
  std::vector<TreeLayout> layouts{TreeLayout::kDefault, TreeLayout::kCompact};
  std::vector<float> twists{0.1f, 1.5f, 6.2831853f};
  std::uint32_t width = 640, height = 400;
  std::string json, mesh;
  bool is_noisy = false;
};

}  // namespace perfect_bvh::bench
