// How a batch of rays is traced. Every way gives the same answers; they differ in what they cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "traverse/kernel_table.h"

namespace perfect_bvh {

enum class Strategy : std::uint8_t {
  kAuto,     // packets where the rays are coherent, put in order first (ray_reordering.h), the stream elsewhere
  kPackets,  // up to 64 consecutive rays share a traversal; the stream where the machine has no kernel for that
  kStream,   // many rays under way in turn
  kSingle,   // one ray after the other
};

struct TraceOptions {
  Strategy strategy = Strategy::kAuto;
  std::size_t in_flight = 0;  // rays under way in the stream, 1 to kMostRaysInFlight; 0 for the best
};

// Dispatch ------------------------------------------------------------------------------------------------------------
// Which kernels run: the best that this machine has, unless PERFECT_BVH_ISA names another ("scalar", "avx2",
// "avx512", "neon").

// Those compiled in that this machine can run, the best last. "scalar" is always the first.
[[nodiscard]] std::span<const KernelTable* const> available_kernels() noexcept;

// The kernels that new batches use. Looked up once; a PERFECT_BVH_ISA that names none of available_kernels() throws
// InvalidArgument at every call.
[[nodiscard]] const KernelTable& active_kernels();

// For tests and benchmarks: overrides the choice from now on; an empty name takes it back. InvalidArgument as above.
void set_active_kernels(std::string_view name);

// Traces on the calling thread with the active kernels, in the default floating-point environment, whatever the
// caller's (another library may have switched denormals off). Returns how many of the rays went in packets; none if
// counts are wanted, which packets do not keep ray by ray.
std::size_t trace_closest(const SceneView& scene, const RayBatch& batch, const TraceOptions& options = {});
std::size_t trace_any(const SceneView& scene, const RayBatch& batch, const TraceOptions& options = {});
// All hits of each ray, or only how many (see FoundHits). Returns how many rays were finished: fewer than all if the
// next one's hits did not fit, of which counts then has how many they are.
[[nodiscard]] std::size_t find_all_hits(const SceneView& scene, const RayBatch& batch, const FoundHits& found);

// The nearest point of the scene to each of the queries.
void find_closest_points(const SceneView& scene, std::span<const PointQuery> queries, std::span<NearestPoint> nearest);

}  // namespace perfect_bvh
