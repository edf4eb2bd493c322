// Embree as a peer: many instances of one mesh, as geometries of their own or as one array.
#pragma once

#include <embree4/rtcore.h>

#include <span>
#include <string>
#include <vector>

#include "math/affine.h"
#include "mesh/triangle_mesh.h"
#include "traverse/ray.h"

namespace perfect_bvh::bench {

class EmbreeInstances {
 public:
  enum class Kind { kGeometries, kArray };
  struct Options {
    std::string device = "threads=1";
    Kind kind = Kind::kGeometries;
    // Of the scene over the instances. Low together with dynamic is Embree's choice for what moves each frame; the
    // mesh's own tree is always MEDIUM.
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    bool is_dynamic = false;
  };

  EmbreeInstances(const TriangleMesh& mesh, std::size_t count, const Options& options);
  ~EmbreeInstances();
  EmbreeInstances(const EmbreeInstances&) = delete;
  EmbreeInstances& operator=(const EmbreeInstances&) = delete;

  void set_transforms(std::span<const Affine> transforms);  // as many as there are instances
  void commit();                                            // the scene alone

  void closest(std::span<const Ray> rays, Hit* hits) const;

 private:
  RTCDevice device_;
  RTCScene mesh_scene_;
  RTCScene scene_;
  Kind kind_;
  std::vector<RTCGeometry> geometries_;  // one an instance, or the array
  float* array_ = nullptr;               // 16 floats a transform, columns
};

}  // namespace perfect_bvh::bench
