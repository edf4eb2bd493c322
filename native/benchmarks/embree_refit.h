// Embree as a peer that follows a deforming mesh: the tree of the first positions, refitted to all later ones.
#pragma once

#include <embree4/rtcore.h>

#include <span>

#include "mesh/triangle_mesh.h"
#include "traverse/ray.h"

namespace perfect_bvh::bench {

class EmbreeRefit {
 public:
  // Builds the tree with Embree's quality REFIT.
  EmbreeRefit(const TriangleMesh& mesh, int thread_count);
  ~EmbreeRefit();
  EmbreeRefit(const EmbreeRefit&) = delete;
  EmbreeRefit& operator=(const EmbreeRefit&) = delete;

  // Returns the seconds from the full buffer to the committed scene.
  double move(std::span<const Vec3f> positions);
  void closest(std::span<const Ray> rays, Hit* hits) const;
  void any(std::span<const Ray> rays, std::uint8_t* occluded) const;

 private:
  int thread_count_;
  RTCDevice device_;
  RTCScene scene_;
  RTCGeometry geometry_;
};

}  // namespace perfect_bvh::bench
