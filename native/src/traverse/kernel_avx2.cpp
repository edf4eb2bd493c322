// The kernels for AVX2 and FMA.
#include "traverse/gather_avx.h"
#include "traverse/leaf_line_avx.h"
#include "traverse/plane_avx.h"
#include "traverse/ray_setup_avx.h"
#include "traverse/simd_avx2.h"
#include "traverse/simd_rays_avx2.h"

// Last: it uses all of the above.
#include "traverse/vector_kernels.inl"

namespace perfect_bvh {

constinit const KernelTable kAvx2Kernels = kernels_named("avx2");

}  // namespace perfect_bvh
