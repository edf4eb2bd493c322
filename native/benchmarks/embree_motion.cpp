#include "embree_motion.h"

#include <cmath>
#include <cstring>

#include "embree_rays.h"
#include "tlas/turns.h"

namespace perfect_bvh::bench {
namespace {

bool is_plain(const MotionScene::Placed& placed) noexcept { return !placed.moves && placed.steps[0] == Affine{}; }

bool turns(const MotionScene::Placed& placed) noexcept {
  for (const Affine& step : placed.steps) {
    const Affine& first = placed.steps[0];
    if (!(step.x == first.x && step.y == first.y && step.z == first.z)) return true;
  }
  return false;
}

void set_matrix(RTCGeometry geometry, unsigned step, const Affine& map) {
  float columns[12];
  float* out = columns;
  for (const Vec3d& column : {map.x, map.y, map.z, map.translation}) {
    for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(column[axis]);
  }
  rtcSetGeometryTransform(geometry, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
}

// Our stretch is symmetric and Embree's is not. They agree as long as the stretch is the same in all directions.
void set_turn(RTCGeometry geometry, unsigned step, const TurnStep& turn) {
  RTCQuaternionDecomposition parts;
  rtcInitQuaternionDecomposition(&parts);
  const auto narrow = [](double value) { return static_cast<float>(value); };
  rtcQuaternionDecompositionSetQuaternion(&parts, narrow(turn.rotation[0]), narrow(turn.rotation[1]),
                                          narrow(turn.rotation[2]), narrow(turn.rotation[3]));
  rtcQuaternionDecompositionSetScale(&parts, narrow(turn.stretch[0]), narrow(turn.stretch[4]), narrow(turn.stretch[8]));
  rtcQuaternionDecompositionSetTranslation(&parts, narrow(turn.translation[0]), narrow(turn.translation[1]),
                                           narrow(turn.translation[2]));
  rtcSetGeometryTransformQuaternion(geometry, step, &parts);
}

}  // namespace

EmbreeMotion::EmbreeMotion(const MotionScene& scene)
    : device_(rtcNewDevice("threads=2")), scene_(rtcNewScene(device_)), meshes_(scene.meshes.size(), nullptr) {
  const EmbreeFloatingPoint mode;
  for (std::size_t row = 0; row < scene.instances.size(); ++row) {
    const MotionScene::Placed& placed = scene.instances[row];
    RTCGeometry geometry = is_plain(placed) ? make_mesh(scene.meshes[placed.mesh]) : make_instance(scene, placed);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_, geometry, static_cast<unsigned>(row));
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene_);
}

EmbreeMotion::~EmbreeMotion() {
  rtcReleaseScene(scene_);
  for (RTCScene mesh : meshes_) {
    if (mesh != nullptr) rtcReleaseScene(mesh);
  }
  rtcReleaseDevice(device_);
}

RTCGeometry EmbreeMotion::make_mesh(const MotionScene::Shapes& shapes) const {
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(shapes.steps.size()));
  for (unsigned step = 0; step < shapes.steps.size(); ++step) {
    const std::vector<Vec3f>& from = shapes.steps[step];
    void* positions =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, sizeof(Vec3f), from.size());
    std::memcpy(positions, from.data(), from.size() * sizeof(Vec3f));
  }
  void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            sizeof(TriangleIndices), shapes.triangles.size());
  std::memcpy(triangles, shapes.triangles.data(), shapes.triangles.size() * sizeof(TriangleIndices));
  return geometry;
}

RTCGeometry EmbreeMotion::make_instance(const MotionScene& scene, const MotionScene::Placed& placed) {
  RTCScene& mesh = meshes_[placed.mesh];
  if (mesh == nullptr) {
    mesh = rtcNewScene(device_);
    RTCGeometry geometry = make_mesh(scene.meshes[placed.mesh]);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(mesh, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(mesh);
  }
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, mesh);
  const unsigned count = placed.moves ? scene.step_count : 1;
  rtcSetGeometryTimeStepCount(geometry, count);
  Turns path;
  for (unsigned step = 0; step < count; ++step) {
    const bool is_turning = placed.moves && turns(placed) && path.add(placed.steps[step]);
    if (is_turning) {
      set_turn(geometry, step, path.steps.back());
    } else {
      set_matrix(geometry, step, placed.steps[step]);
    }
  }
  return geometry;
}

}  // namespace perfect_bvh::bench
