// The table that every translation unit of kernels exports.
#pragma once

#include <cstddef>

#include "traverse/scene_view.h"

namespace perfect_bvh {

// The maximum number of rays in flight at the same time.
inline constexpr std::size_t kMostRaysInFlight = 64;

// The number of rays that share a traversal.
inline constexpr unsigned kPacketRays = 64;

struct KernelTable {
  const char* name;
  // `workspace` has workspace_bytes(scene, in_flight) bytes, aligned to a cache line; in_flight is 1 to
  // kMostRaysInFlight.
  void (*trace_closest)(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight);
  void (*trace_any)(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight);
  // Returns the number of rays finished: less than all if the hits of the next ray did not fit. The workspace is that
  // for one ray in flight.
  std::size_t (*find_all_hits)(const SceneView& scene, const RayBatch& batch, const FoundHits& found, void* workspace);
  // `workspace` has point_workspace_bytes(scene) bytes.
  void (*find_closest_points)(const SceneView& scene, const PointQuery* queries, std::size_t count,
                              NearestPoint* nearest, void* workspace);
  std::size_t (*point_workspace_bytes)(const SceneView& scene);
  std::size_t (*workspace_bytes)(const SceneView& scene, std::size_t in_flight);
  // Give the same answers, for coherent rays, in packets of consecutive rays; without counts. `left`: null, or one flag
  // per packet, set if its rays are not coherent; those are left untraced. The functions are null if vectors are too
  // short for packets to pay off.
  void (*trace_packets_closest)(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left);
  void (*trace_packets_any)(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left);
  std::size_t (*packet_workspace_bytes)(const SceneView& scene);
};

extern const KernelTable kScalarKernels;
extern const KernelTable kAvx2Kernels;
extern const KernelTable kAvx512Kernels;
extern const KernelTable kNeonKernels;

}  // namespace perfect_bvh
