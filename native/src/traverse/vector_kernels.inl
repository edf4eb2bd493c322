// All kernels of one instruction set with vectors, and their table. Included last, by a translation unit that has
// already included its vectors, ray set-up and sphere reads (isa_*.h).
#pragma once

#include "math/distance.h"
#include "math/turning.h"
#include "traverse/kernel_table.h"
#include "traverse/stream_kernel.inl"
// After the stream.
#include "traverse/all_hits.inl"
#include "traverse/closest_point.inl"
#include "traverse/packet_kernel.inl"

namespace perfect_bvh {
namespace {

constexpr KernelTable kernels_named(const char* name) noexcept {
  return {name,
          trace_in_stream<false>,
          trace_in_stream<true>,
          find_all_hits,
          find_closest_points,
          point_workspace_bytes,
          stream_workspace_bytes,
          trace_in_packets<false>,
          trace_in_packets<true>,
          packet_workspace_bytes};
}

}  // namespace
}  // namespace perfect_bvh
