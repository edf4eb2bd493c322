// The kernels for NEON, which every 64-bit ARM has.
#include "math/triangle_distance.h"
#include "traverse/gather_neon.h"
#include "traverse/kernel_table.h"
#include "traverse/plane_scalar.h"
#include "traverse/ray_setup_neon.h"
#include "traverse/simd_neon.h"
#include "traverse/simd_rays_neon.h"

// The vectors and the ray's set-up stand; what follows uses them.
#include "traverse/stream_kernel.inl"
// After the stream.
#include "traverse/all_hits.inl"
#include "traverse/closest_point.inl"
#include "traverse/packet_kernel.inl"

namespace perfect_bvh {

const KernelTable kNeonKernels = {"neon",
                                  trace_stream_closest,
                                  trace_stream_any,
                                  find_all_hits,
                                  find_closest_points,
                                  point_workspace_bytes,
                                  stream_workspace_bytes,
                                  trace_packets_closest,
                                  trace_packets_any,
                                  packet_workspace_bytes};

}  // namespace perfect_bvh
