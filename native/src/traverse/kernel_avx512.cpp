// The kernels for AVX-512 (F, BW, DQ, VL).
#include "traverse/isa_avx.h"
#include "traverse/isa_avx512.h"

// Last: it uses all headers above.
#include "traverse/vector_kernels.inl"

namespace perfect_bvh {

constinit const KernelTable kAvx512Kernels = kernels_named("avx512");

}  // namespace perfect_bvh
