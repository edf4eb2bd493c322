// The kernels for AVX-512 (F, BW, DQ, VL).
#include "traverse/gather_avx.h"
#include "traverse/leaf_line_avx.h"
#include "traverse/plane_avx.h"
#include "traverse/ray_setup_avx.h"
#include "traverse/simd_avx512.h"
#include "traverse/simd_rays_avx512.h"

// Last: it uses all of the above.
#include "traverse/vector_kernels.inl"

namespace perfect_bvh {

constinit const KernelTable kAvx512Kernels = kernels_named("avx512");

}  // namespace perfect_bvh
