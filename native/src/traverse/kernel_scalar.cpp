// The kernels for any machine.
#include "math/distance.h"
#include "math/turning.h"
#include "traverse/isa_scalar.h"
#include "traverse/kernel_table.h"
#include "traverse/leaf_line_scalar.h"

// The files below use the vectors and ray set-up above.
#include "traverse/stream_kernel.inl"
// After the stream.
#include "traverse/all_hits.inl"
#include "traverse/closest_point.inl"

namespace perfect_bvh {

const KernelTable kScalarKernels = {"scalar",
                                    trace_in_stream<false>,
                                    trace_in_stream<true>,
                                    find_all_hits,
                                    find_closest_points,
                                    point_workspace_bytes,
                                    stream_workspace_bytes,
                                    nullptr,
                                    nullptr,
                                    nullptr};

}  // namespace perfect_bvh
