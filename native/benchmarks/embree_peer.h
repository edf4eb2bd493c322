// Embree as a peer: one scene over one mesh.
#pragma once

#include <embree4/rtcore.h>

#include <memory>
#include <string>

#include "mesh/mesh.h"
#include "ray_caster.h"

namespace perfect_bvh::bench {

// Copies the mesh into a new geometry, which is not yet committed. In a scene of low quality each geometry's quality
// chooses the builder.
[[nodiscard]] RTCGeometry make_geometry(RTCDevice device, const Mesh& mesh,
                                        RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);

// Copies the mesh into a geometry of the scene.
void add_mesh(RTCDevice device, RTCScene scene, const Mesh& mesh, RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);

class EmbreePeer {
 public:
  struct Options {
    // e.g. "threads=2,isa=avx2". Threads are only for building. With one thread per device and several devices, a TBB
    // worker never slept, and its polling disturbed the measurements.
    std::string device = "threads=2";
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    bool is_robust = false;
  };

  // Reads the options from a peer's name, which may contain avx2, robust, high.
  [[nodiscard]] static Options named(const std::string& name);

  EmbreePeer(const Mesh& mesh, const Options& options);
  ~EmbreePeer();
  EmbreePeer(const EmbreePeer&) = delete;
  EmbreePeer& operator=(const EmbreePeer&) = delete;

  // Bytes of the scene, including its copy of the mesh.
  [[nodiscard]] std::size_t byte_count() const noexcept { return static_cast<std::size_t>(byte_count_); }
  [[nodiscard]] RTCScene scene() const noexcept { return scene_; }

 private:
  static bool count_bytes(void* self, ssize_t change, bool);

  RTCDevice device_;
  RTCScene scene_;
  ssize_t byte_count_ = 0;
};

// Casts at the peer's scene: 16 rays a call if the name contains "packets", otherwise one.
[[nodiscard]] RayCompetitor embree_competitor(const std::string& name, std::shared_ptr<const EmbreePeer> peer);

}  // namespace perfect_bvh::bench
