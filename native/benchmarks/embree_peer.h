// Embree as a peer: one scene over one mesh.
#pragma once

#include <embree4/rtcore.h>

#include <memory>
#include <string>

#include "mesh/mesh.h"
#include "ray_caster.h"

namespace perfect_bvh::bench {

// Copies the mesh; not yet committed. A scene of low quality leaves the choice of the builder to each geometry's
// quality.
[[nodiscard]] RTCGeometry make_geometry(RTCDevice device, const Mesh& mesh,
                                        RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);

// Copies the mesh into a geometry of the scene.
void add_mesh(RTCDevice device, RTCScene scene, const Mesh& mesh, RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);

class EmbreePeer {
 public:
  struct Options {
    // e.g. "threads=2,isa=avx2". Threads are for building alone. With one each, a worker of TBB's never slept once
    // there were several devices, and asked for work beside whatever was being measured.
    std::string device = "threads=2";
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    bool is_robust = false;
  };

  // By what a peer's name contains: avx2, robust, high.
  [[nodiscard]] static Options named(const std::string& name);

  EmbreePeer(const Mesh& mesh, const Options& options);
  ~EmbreePeer();
  EmbreePeer(const EmbreePeer&) = delete;
  EmbreePeer& operator=(const EmbreePeer&) = delete;

  // Of the scene, its copy of the mesh included.
  [[nodiscard]] std::size_t byte_count() const noexcept { return static_cast<std::size_t>(byte_count_); }
  [[nodiscard]] RTCScene scene() const noexcept { return scene_; }

 private:
  static bool count_bytes(void* self, ssize_t change, bool);

  RTCDevice device_;
  RTCScene scene_;
  ssize_t byte_count_ = 0;
};

// Casts at the peer's scene: a name that contains "packets" means 16 rays a call, any other one.
[[nodiscard]] RayCompetitor embree_competitor(const std::string& name, std::shared_ptr<const EmbreePeer> peer);

}  // namespace perfect_bvh::bench
