#include "embree_peer.h"

#include <algorithm>
#include <atomic>
#include <cstring>

namespace perfect_bvh::bench {

namespace {

void set_ray(RTCRay& out, const Ray& ray) {
  out.org_x = static_cast<float>(ray.origin.x), out.org_y = static_cast<float>(ray.origin.y);
  out.org_z = static_cast<float>(ray.origin.z), out.tnear = ray.t_min;
  out.dir_x = static_cast<float>(ray.direction.x), out.dir_y = static_cast<float>(ray.direction.y);
  out.dir_z = static_cast<float>(ray.direction.z), out.tfar = ray.t_max;
  out.time = 0, out.mask = ~0u, out.id = 0, out.flags = 0;
}

}  // namespace

RTCGeometry make_geometry(RTCDevice device, const TriangleMesh& mesh, RTCBuildQuality quality) {
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

void add_mesh(RTCDevice device, RTCScene scene, const TriangleMesh& mesh, RTCBuildQuality quality) {
  RTCGeometry geometry = make_geometry(device, mesh, quality);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

void intersect_one_by_one(RTCScene scene, std::span<const Ray> rays, Hit* hits) {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RTCRayHit query;
    set_ray(query.ray, rays[i]);
    query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &query, nullptr);
    const bool found = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    hits[i] = found ? Hit{query.ray.tfar, query.hit.u, query.hit.v, 0, query.hit.primID} : Hit{};
  }
}

void occlude_one_by_one(RTCScene scene, std::span<const Ray> rays, std::uint8_t* occluded) {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RTCRay query;
    set_ray(query, rays[i]);
    rtcOccluded1(scene, &query, nullptr);
    occluded[i] = query.tfar < 0 ? 1 : 0;
  }
}

EmbreePeer::Options EmbreePeer::named(const std::string& name) {
  const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
  Options options;
  options.is_robust = has("robust");
  options.is_compact = has("compact");
  if (has("avx2")) options.device += ",isa=avx2";
  if (has("high")) options.quality = RTC_BUILD_QUALITY_HIGH;
  return options;
}

EmbreePeer::EmbreePeer(const TriangleMesh& mesh, const Options& options)
    : device_(rtcNewDevice(options.device.c_str())), scene_(rtcNewScene(device_)) {
  rtcSetDeviceMemoryMonitorFunction(device_, &EmbreePeer::count_bytes, this);
  int flags = RTC_SCENE_FLAG_NONE;
  if (options.is_robust) flags |= RTC_SCENE_FLAG_ROBUST;
  if (options.is_compact) flags |= RTC_SCENE_FLAG_COMPACT;
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

void EmbreePeer::closest(std::span<const Ray> rays, Hit* hits) const { intersect_one_by_one(scene_, rays, hits); }

void EmbreePeer::any(std::span<const Ray> rays, std::uint8_t* occluded) const {
  occlude_one_by_one(scene_, rays, occluded);
}

void EmbreePeer::closest_packets(std::span<const Ray> rays, Hit* hits, bool is_coherent) const {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = is_coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  for (std::size_t first = 0; first < rays.size(); first += 16) {
    const std::size_t count = std::min<std::size_t>(16, rays.size() - first);
    alignas(64) RTCRayHit16 query;
    alignas(64) int valid[16];
    for (std::size_t i = 0; i < 16; ++i) {
      const Ray& ray = rays[first + std::min(i, count - 1)];
      valid[i] = i < count ? -1 : 0;
      query.ray.org_x[i] = static_cast<float>(ray.origin.x), query.ray.org_y[i] = static_cast<float>(ray.origin.y);
      query.ray.org_z[i] = static_cast<float>(ray.origin.z), query.ray.tnear[i] = ray.t_min;
      query.ray.dir_x[i] = static_cast<float>(ray.direction.x),
      query.ray.dir_y[i] = static_cast<float>(ray.direction.y);
      query.ray.dir_z[i] = static_cast<float>(ray.direction.z), query.ray.tfar[i] = ray.t_max;
      query.ray.time[i] = 0, query.ray.mask[i] = ~0u, query.ray.id[i] = 0, query.ray.flags[i] = 0;
      query.hit.geomID[i] = query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid, scene_, &query, &arguments);
    for (std::size_t i = 0; i < count; ++i) {
      const bool found = query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      hits[first + i] = found ? Hit{query.ray.tfar[i], query.hit.u[i], query.hit.v[i], 0, query.hit.primID[i]} : Hit{};
    }
  }
}

}  // namespace perfect_bvh::bench
