#include "embree_build.h"

#include <atomic>
#include <stdexcept>
#include <string>

#include "embree_peer.h"
#include "embree_rays.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {

RTCBuildQuality embree_quality(const std::string& peer) {
  if (peer == "embree_low") return RTC_BUILD_QUALITY_LOW;
  if (peer == "embree_medium") return RTC_BUILD_QUALITY_MEDIUM;
  if (peer == "embree_high") return RTC_BUILD_QUALITY_HIGH;
  throw std::runtime_error("no peer is called " + peer + "; there are embree_low, embree_medium, embree_high");
}

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

double EmbreeBuilder::build(const Mesh& mesh) {
  const ssize_t bytes_before = byte_count_;
  const EmbreeFloatingPoint mode;
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
