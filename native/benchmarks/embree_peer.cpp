#include "embree_peer.h"

#include <atomic>
#include <cstring>

#include "embree_rays.h"

namespace perfect_bvh::bench {

RTCGeometry make_geometry(RTCDevice device, const Mesh& mesh, RTCBuildQuality quality) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, quality);
  void* positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                            mesh.positions.size());
  std::memcpy(positions, mesh.positions.data(), mesh.positions.size() * sizeof(Vec3f));
  void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            sizeof(TriangleIndices), mesh.triangles.size());
  std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * sizeof(TriangleIndices));
  return geometry;
}

void add_mesh(RTCDevice device, RTCScene scene, const Mesh& mesh, RTCBuildQuality quality) {
  RTCGeometry geometry = make_geometry(device, mesh, quality);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

EmbreePeer::Options EmbreePeer::named(const std::string& name) {
  const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
  Options options;
  options.is_robust = has("robust");
  if (has("avx2")) options.device += ",isa=avx2";
  if (has("high")) options.quality = RTC_BUILD_QUALITY_HIGH;
  return options;
}

EmbreePeer::EmbreePeer(const Mesh& mesh, const Options& options)
    : device_(rtcNewDevice(options.device.c_str())), scene_(rtcNewScene(device_)) {
  const EmbreeFloatingPoint mode;
  rtcSetDeviceMemoryMonitorFunction(device_, &EmbreePeer::count_bytes, this);
  int flags = RTC_SCENE_FLAG_NONE;
  if (options.is_robust) flags |= RTC_SCENE_FLAG_ROBUST;
  rtcSetSceneFlags(scene_, static_cast<RTCSceneFlags>(flags));
  rtcSetSceneBuildQuality(scene_, options.quality);
  add_mesh(device_, scene_, mesh, options.quality);
  rtcCommitScene(scene_);
}

bool EmbreePeer::count_bytes(void* self, ssize_t change, bool) {
  std::atomic_ref(static_cast<EmbreePeer*>(self)->byte_count_).fetch_add(change);
  return true;
}

EmbreePeer::~EmbreePeer() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

RayCompetitor embree_competitor(const std::string& name, std::shared_ptr<const EmbreePeer> peer) {
  const RTCScene scene = peer->scene();
  if (name.find("packets") != std::string::npos) {
    return {name, std::make_shared<EmbreePackets>(std::move(peer), scene)};
  }
  return {name, std::make_shared<EmbreeRays>(std::move(peer), scene)};
}

}  // namespace perfect_bvh::bench
