// Embree as a peer: how long it takes from a mesh to a committed scene, and how many bytes that has.
#pragma once

#include <embree4/rtcore.h>

#include <cstddef>
#include <string>

#include "mesh/mesh.h"

namespace perfect_bvh::bench {

// Of embree_low, embree_medium or embree_high. Throws std::runtime_error for others.
[[nodiscard]] RTCBuildQuality embree_quality(const std::string& peer);

class EmbreeBuilder {
 public:
  EmbreeBuilder(RTCBuildQuality quality, int thread_count);
  ~EmbreeBuilder();
  EmbreeBuilder(const EmbreeBuilder&) = delete;
  EmbreeBuilder& operator=(const EmbreeBuilder&) = delete;

  // A new scene over a copy of the mesh. Returns the seconds from the full buffers to the committed scene.
  double build(const Mesh& mesh);
  // Of the last scene while it stood: its trees, positions and triangles.
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
