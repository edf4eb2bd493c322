// The kernels for AVX-512 (F, BW, DQ, VL).
#include "traverse/simd_avx512.h"
// clang-format: the vectors must be known first
#include "traverse/stream_kernel.inl"

namespace perfect_bvh {

const KernelTable kAvx512Kernels = {"avx512", trace_stream_closest, trace_stream_any, stream_workspace_bytes};

}  // namespace perfect_bvh
