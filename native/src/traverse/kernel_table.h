// What every translation unit of kernels exports: one table.
#pragma once

#include <cstddef>

#include "traverse/scene_view.h"

namespace perfect_bvh {

// Rays that are under way at the same time, at most.
inline constexpr std::size_t kMostRaysInFlight = 64;

// Rays that share a traversal.
inline constexpr unsigned kPacketRays = 64;

struct KernelTable {
  const char* name;
  // `workspace` holds workspace_bytes(scene, in_flight), on a cache line; in_flight is 1 to kMostRaysInFlight.
  void (*trace_closest)(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight);
  void (*trace_any)(const SceneView& scene, const RayBatch& batch, void* workspace, std::size_t in_flight);
  // Returns how many rays were finished: fewer than all if the next one's hits did not fit. Workspace as for one ray in
  // flight.
  std::size_t (*find_all_hits)(const SceneView& scene, const RayBatch& batch, const FoundHits& found, void* workspace);
  // `workspace` holds point_workspace_bytes(scene).
  void (*find_closest_points)(const SceneView& scene, const PointQuery* queries, std::size_t count,
                              NearestPoint* nearest, void* workspace);
  std::size_t (*point_workspace_bytes)(const SceneView& scene);
  std::size_t (*workspace_bytes)(const SceneView& scene, std::size_t in_flight);
  // The same answers, for coherent rays, in packets of consecutive ones; no counts. `left`: null, or one a packet: set
  // where the rays are not coherent, which are then left untraced. Null where vectors are too short to repay it.
  void (*trace_packets_closest)(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left);
  void (*trace_packets_any)(const SceneView& scene, const RayBatch& batch, void* workspace, bool* left);
  std::size_t (*packet_workspace_bytes)(const SceneView& scene);
};

extern const KernelTable kScalarKernels;
extern const KernelTable kAvx2Kernels;
extern const KernelTable kAvx512Kernels;
extern const KernelTable kNeonKernels;

}  // namespace perfect_bvh
