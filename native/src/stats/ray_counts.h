// What tracing a ray cost.
#pragma once

#include <cstdint>

namespace perfect_bvh {

struct RayCounts {
  std::uint32_t nodes_visited = 0;  // of both levels; an instance that is entered counts as one
  std::uint32_t primitives_tested = 0;
};

}  // namespace perfect_bvh
