#include "embree_refit.h"

#include <algorithm>
#include <string>

#include "embree_peer.h"
#include "embree_rays.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {

EmbreeRefit::EmbreeRefit(const Mesh& mesh, int thread_count)
    : thread_count_(thread_count),
      device_(rtcNewDevice(("threads=" + std::to_string(thread_count)).c_str())),
      scene_(rtcNewScene(device_)),
      geometry_(make_geometry(device_, mesh, RTC_BUILD_QUALITY_REFIT)) {
  const EmbreeFloatingPoint mode;
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);  // leaves the choice to the geometry
  rtcCommitGeometry(geometry_);
  rtcAttachGeometry(scene_, geometry_);
  rtcCommitScene(scene_);
}

EmbreeRefit::~EmbreeRefit() {
  rtcReleaseGeometry(geometry_);
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

double EmbreeRefit::move(std::span<const Vec3f> positions) {
  auto* const buffer = static_cast<Vec3f*>(rtcGetGeometryBufferData(geometry_, RTC_BUFFER_TYPE_VERTEX, 0));
  std::copy(positions.begin(), positions.end(), buffer);
  rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
  const EmbreeFloatingPoint mode;
  const double start = seconds(thread_count_);
  rtcCommitGeometry(geometry_);
  rtcCommitScene(scene_);
  return seconds(thread_count_) - start;
}

}  // namespace perfect_bvh::bench
