// The kernels for AVX2 and FMA.
#include "traverse/isa_avx.h"
#include "traverse/isa_avx2.h"

// Last: it uses all headers above.
#include "traverse/vector_kernels.inl"

namespace perfect_bvh {

constinit const KernelTable kAvx2Kernels = kernels_named("avx2");

}  // namespace perfect_bvh
