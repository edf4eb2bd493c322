#include "embree_build.h"

#include <atomic>
#include <string>

#include "embree_peer.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {

EmbreeBuilder::EmbreeBuilder(RTCBuildQuality quality, int thread_count)
    : quality_(quality),
      thread_count_(thread_count),
      device_(rtcNewDevice(("threads=" + std::to_string(thread_count)).c_str())) {
  rtcSetDeviceMemoryMonitorFunction(device_, &EmbreeBuilder::count_bytes, this);
}

EmbreeBuilder::~EmbreeBuilder() { rtcReleaseDevice(device_); }

bool EmbreeBuilder::count_bytes(void* self, ssize_t change, bool) {
  std::atomic_ref(static_cast<EmbreeBuilder*>(self)->byte_count_).fetch_add(change);
  return true;
}

double EmbreeBuilder::build(const TriangleMesh& mesh) {
  const ssize_t bytes_before = byte_count_;
  RTCScene scene = rtcNewScene(device_);
  rtcSetSceneBuildQuality(scene, quality_);
  RTCGeometry geometry = make_geometry(device_, mesh, quality_);
  const double start = seconds(thread_count_);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcCommitScene(scene);
  const double taken = seconds(thread_count_) - start;
  built_byte_count_ = static_cast<std::size_t>(byte_count_ - bytes_before);
  rtcReleaseGeometry(geometry);
  rtcReleaseScene(scene);
  return taken;
}

}  // namespace perfect_bvh::bench
