// Strategies for tracing a batch of rays. All give the same answers; they differ in cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "traverse/kernel_table.h"

namespace perfect_bvh {

enum class Strategy : std::uint8_t {
  kAuto,     // packets for coherent rays, reordered first (ray_reordering.h), the stream for the others
  kPackets,  // up to 64 consecutive rays share a traversal; the stream if the machine has no packet kernel
  kStream,   // many rays in flight take turns
  kSingle,   // one ray after another
};

struct TraceOptions {
  Strategy strategy = Strategy::kAuto;
  std::size_t in_flight = 0;  // rays in flight in the stream, 1 to kMostRaysInFlight; 0 for the best
};

// Dispatch ------------------------------------------------------------------------------------------------------------
// Chooses the kernels: the best that this machine can run, unless PERFECT_BVH_ISA names others ("scalar", "avx2",
// "avx512", "neon").

// Returns the compiled-in kernels that this machine can run, the best last. "scalar" is always the first.
[[nodiscard]] std::span<const KernelTable* const> available_kernels() noexcept;

// Returns the kernels that new batches use. The lookup happens once. If PERFECT_BVH_ISA names none of
// available_kernels(), every call throws InvalidArgument.
[[nodiscard]] const KernelTable& active_kernels();

// Overrides the choice, for tests and benchmarks; an empty name restores it. Throws InvalidArgument as above.
void set_active_kernels(std::string_view name);

// Traces on the calling thread with the active kernels. Always uses the default floating-point environment: another
// library may have switched denormals off. Returns the number of rays traced in packets; 0 if counts are requested,
// because packets do not count per ray.
std::size_t trace_closest(const SceneView& scene, const RayBatch& batch, const TraceOptions& options = {});
std::size_t trace_any(const SceneView& scene, const RayBatch& batch, const TraceOptions& options = {});
// Finds all hits of each ray, or only their number (see FoundHits). Returns the number of rays finished. It is less
// than all if the hits of the next ray did not fit; `counts` then has that ray's number of hits.
[[nodiscard]] std::size_t find_all_hits(const SceneView& scene, const RayBatch& batch, const FoundHits& found);

// Finds the nearest point of the scene to each of the queries.
void find_closest_points(const SceneView& scene, std::span<const PointQuery> queries, std::span<NearestPoint> nearest);

}  // namespace perfect_bvh
