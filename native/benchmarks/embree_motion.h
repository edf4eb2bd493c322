// Embree as a peer for scenes that move within the shutter: its motion blur, with the same number of steps.
#pragma once

#include <embree4/rtcore.h>

#include "motion_scene.h"

namespace perfect_bvh::bench {

// A mesh that is placed once, without motion and transform, is in the scene itself; the others are instances. Instances
// that turn have quaternions (as ours do), those that only shift have matrices. A hit's instance is a geometry's
// number: the row in the scene.
class EmbreeMotion {
 public:
  explicit EmbreeMotion(const MotionScene& scene);
  ~EmbreeMotion();
  EmbreeMotion(const EmbreeMotion&) = delete;
  EmbreeMotion& operator=(const EmbreeMotion&) = delete;

  [[nodiscard]] RTCScene scene() const noexcept { return scene_; }

 private:
  [[nodiscard]] RTCGeometry make_mesh(const MotionScene::Shapes& shapes) const;
  [[nodiscard]] RTCGeometry make_instance(const MotionScene& scene, const MotionScene::Placed& placed);

  RTCDevice device_;
  RTCScene scene_;
  std::vector<RTCScene> meshes_;  // by mesh; null where none is instanced
};

}  // namespace perfect_bvh::bench
