// The kernels for NEON, which every 64-bit ARM has.
#include "traverse/isa_neon.h"
#include "traverse/leaf_line_scalar.h"
#include "traverse/rays_neon.h"

// Last: it uses all headers above.
#include "traverse/vector_kernels.inl"

namespace perfect_bvh {

constinit const KernelTable kNeonKernels = kernels_named("neon");

}  // namespace perfect_bvh
