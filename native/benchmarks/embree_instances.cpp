#include "embree_instances.h"

#include <cstring>

#include "embree_peer.h"

namespace perfect_bvh::bench {
namespace {

// Three rows a column; `stride` floats from column to column.
void write_columns(const Affine& map, float* out, std::size_t stride) {
  for (const Vec3d& column : {map.x, map.y, map.z, map.translation}) {
    for (int axis = 0; axis < 3; ++axis) out[axis] = static_cast<float>(column[axis]);
    out += stride;
  }
}

}  // namespace

EmbreeInstances::EmbreeInstances(const TriangleMesh& mesh, std::size_t count, const Options& options)
    : device_(rtcNewDevice(options.device.c_str())),
      mesh_scene_(rtcNewScene(device_)),
      scene_(rtcNewScene(device_)),
      kind_(options.kind) {
  add_mesh(device_, mesh_scene_, mesh);
  rtcCommitScene(mesh_scene_);
  if (options.is_dynamic) rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
  rtcSetSceneBuildQuality(scene_, options.quality);
  const bool is_array = kind_ == Kind::kArray;
  const RTCGeometryType type = is_array ? RTC_GEOMETRY_TYPE_INSTANCE_ARRAY : RTC_GEOMETRY_TYPE_INSTANCE;
  geometries_.resize(is_array ? 1 : count);
  for (RTCGeometry& geometry : geometries_) {
    geometry = rtcNewGeometry(device_, type);
    rtcSetGeometryInstancedScene(geometry, mesh_scene_);
    rtcSetGeometryBuildQuality(geometry, options.quality);
    if (is_array) {
      array_ = static_cast<float*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_TRANSFORM, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, 16 * sizeof(float), count));
    }
    rtcAttachGeometry(scene_, geometry);
  }
}

EmbreeInstances::~EmbreeInstances() {
  for (RTCGeometry geometry : geometries_) rtcReleaseGeometry(geometry);
  rtcReleaseScene(scene_);
  rtcReleaseScene(mesh_scene_);
  rtcReleaseDevice(device_);
}

void EmbreeInstances::set_transforms(std::span<const Affine> transforms) {
  if (kind_ == Kind::kGeometries) {
    for (std::size_t i = 0; i < transforms.size(); ++i) {
      float columns[12];
      write_columns(transforms[i], columns, 3);
      rtcSetGeometryTransform(geometries_[i], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
      rtcCommitGeometry(geometries_[i]);
    }
    return;
  }
  for (std::size_t i = 0; i < transforms.size(); ++i) {
    write_columns(transforms[i], array_ + 16 * i, 4);
    array_[16 * i + 15] = 1.0f;
  }
  rtcUpdateGeometryBuffer(geometries_[0], RTC_BUFFER_TYPE_TRANSFORM, 0);
  rtcCommitGeometry(geometries_[0]);
}

void EmbreeInstances::commit() { rtcCommitScene(scene_); }

void EmbreeInstances::closest(std::span<const Ray> rays, Hit* hits) const { intersect_one_by_one(scene_, rays, hits); }

}  // namespace perfect_bvh::bench
