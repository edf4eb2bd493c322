// Embree as a peer that follows a deforming mesh: it builds the tree for the first positions, and refits it to later
// ones.
#pragma once

#include <embree4/rtcore.h>

#include <span>

#include "mesh/mesh.h"

namespace perfect_bvh::bench {

class EmbreeRefit {
 public:
  // Builds the tree with Embree's quality REFIT.
  EmbreeRefit(const Mesh& mesh, int thread_count);
  ~EmbreeRefit();
  EmbreeRefit(const EmbreeRefit&) = delete;
  EmbreeRefit& operator=(const EmbreeRefit&) = delete;

  // Returns the seconds from the full buffer to the committed scene.
  double move(std::span<const Vec3f> positions);
  [[nodiscard]] RTCScene scene() const noexcept { return scene_; }

 private:
  int thread_count_;
  RTCDevice device_;
  RTCScene scene_;
  RTCGeometry geometry_;
};

}  // namespace perfect_bvh::bench
