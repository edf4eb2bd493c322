// The kernels for AVX-512 (F, BW, DQ, VL).
#include "math/triangle_distance.h"
#include "traverse/gather_avx.h"
#include "traverse/kernel_table.h"
#include "traverse/plane_avx.h"
#include "traverse/ray_setup_avx.h"
#include "traverse/simd_avx512.h"
#include "traverse/simd_rays_avx512.h"

// The vectors and the ray's set-up stand; what follows uses them.
#include "traverse/stream_kernel.inl"
// After the stream.
#include "traverse/all_hits.inl"
#include "traverse/closest_point.inl"
#include "traverse/packet_kernel.inl"

namespace perfect_bvh {

const KernelTable kAvx512Kernels = {"avx512",
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
