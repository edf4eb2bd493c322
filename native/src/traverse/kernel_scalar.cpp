// The kernels for any machine.
#include "traverse/simd_scalar.h"
// clang-format: the vectors must be known first
#include "traverse/stream_kernel.inl"

namespace perfect_bvh {

const KernelTable kScalarKernels = {"scalar", trace_stream_closest, trace_stream_any, stream_workspace_bytes};

}  // namespace perfect_bvh
