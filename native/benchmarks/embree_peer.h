// Embree as a peer: one scene over one mesh, rays one by one.
#pragma once

#include <embree4/rtcore.h>

#include <span>
#include <string>

#include "mesh/triangle_mesh.h"
#include "traverse/ray.h"

namespace perfect_bvh::bench {

// Copies the mesh; not yet committed. A scene of low quality leaves the choice of the builder to each geometry's
// quality.
[[nodiscard]] RTCGeometry make_geometry(RTCDevice device, const TriangleMesh& mesh,
                                        RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);

// Copies the mesh into a geometry of the scene.
void add_mesh(RTCDevice device, RTCScene scene, const TriangleMesh& mesh,
              RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM);
// One rtcIntersect1 a ray. Instances are not told apart.
void intersect_one_by_one(RTCScene scene, std::span<const Ray> rays, Hit* hits);
// One rtcOccluded1 a ray.
void occlude_one_by_one(RTCScene scene, std::span<const Ray> rays, std::uint8_t* occluded);

class EmbreePeer {
 public:
  struct Options {
    std::string device = "threads=1";  // e.g. "threads=1,isa=avx2"
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    bool is_robust = false;
    bool is_compact = false;
  };

  // By what a peer's name contains: avx2, robust, compact, high.
  [[nodiscard]] static Options named(const std::string& name);

  EmbreePeer(const TriangleMesh& mesh, const Options& options);
  ~EmbreePeer();
  EmbreePeer(const EmbreePeer&) = delete;
  EmbreePeer& operator=(const EmbreePeer&) = delete;

  // Of the scene, its copy of the mesh included.
  [[nodiscard]] std::size_t byte_count() const noexcept { return static_cast<std::size_t>(byte_count_); }

  void closest(std::span<const Ray> rays, Hit* hits) const;
  void any(std::span<const Ray> rays, std::uint8_t* occluded) const;
  // Rays in groups of 16, as rtcIntersect16 takes them; coherent says so to Embree.
  void closest_packets(std::span<const Ray> rays, Hit* hits, bool is_coherent) const;

 private:
  static bool count_bytes(void* self, ssize_t change, bool);

  RTCDevice device_;
  RTCScene scene_;
  ssize_t byte_count_ = 0;
};

}  // namespace perfect_bvh::bench
