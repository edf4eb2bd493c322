// Embree as a peer: the time from a mesh to a committed scene, and the scene's size in bytes.
#pragma once

#include <embree4/rtcore.h>

#include <cstddef>
#include <string>

#include "mesh/mesh.h"

namespace perfect_bvh::bench {

// peer: embree_low, embree_medium or embree_high. Throws std::runtime_error for others.
[[nodiscard]] RTCBuildQuality embree_quality(const std::string& peer);

class EmbreeBuilder {
 public:
  EmbreeBuilder(RTCBuildQuality quality, int thread_count);
  ~EmbreeBuilder();
  EmbreeBuilder(const EmbreeBuilder&) = delete;
  EmbreeBuilder& operator=(const EmbreeBuilder&) = delete;

  // Builds a new scene over a copy of the mesh. Returns the seconds from the full buffers to the committed scene.
  double build(const Mesh& mesh);
  // Size of the last scene while it existed: its trees, positions and triangles.
  [[nodiscard]] std::size_t byte_count() const { return built_byte_count_; }

 private:
  static bool count_bytes(void* self, ssize_t change, bool after);

  RTCBuildQuality quality_;
  int thread_count_;
  RTCDevice device_;
  ssize_t byte_count_ = 0;
  std::size_t built_byte_count_ = 0;
};

}  // namespace perfect_bvh::bench
