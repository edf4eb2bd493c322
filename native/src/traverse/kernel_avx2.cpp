// The kernels for AVX2 and FMA.
#include "traverse/simd_avx2.h"
// clang-format: the vectors must be known first
#include "traverse/stream_kernel.inl"

namespace perfect_bvh {

const KernelTable kAvx2Kernels = {"avx2", trace_stream_closest, trace_stream_any, stream_workspace_bytes};

}  // namespace perfect_bvh
