#include "embree_round.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "embree_rays.h"
#include "stopwatch.h"

namespace perfect_bvh::bench {
namespace {

RTCGeometryType type_of(const RoundScene& scene, EmbreeShape shape) {
  if (!scene.has_curves()) return RTC_GEOMETRY_TYPE_SPHERE_POINT;
  if (shape == EmbreeShape::kFlat) return RTC_GEOMETRY_TYPE_FLAT_LINEAR_CURVE;
  return shape == EmbreeShape::kRound ? RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE
                                      : RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE;
}

Ball ball_of(const RoundScene& scene, std::size_t row) { return {scene.centres[row], scene.radii[row]}; }

// Lists the first sphere of each segment; for a cubic segment the first of its four.
struct Segments {
  std::vector<Ball> balls;
  std::vector<std::uint32_t> firsts;
  std::vector<std::uint8_t> neighbours;
};

Segments list_segments(const RoundScene& scene, bool is_cubic) {
  Segments list;
  for (std::size_t curve = 0; curve + 1 < scene.offsets.size(); ++curve) {
    const auto first = static_cast<std::size_t>(scene.offsets[curve]);
    const auto last = static_cast<std::size_t>(scene.offsets[curve + 1]) - 1;
    if (is_cubic) list.balls.push_back(ball_of(scene, first));
    for (std::size_t row = first; row <= last; ++row) {
      list.balls.push_back(ball_of(scene, row));
      if (row == last) continue;
      list.firsts.push_back(static_cast<std::uint32_t>(list.balls.size()) - (is_cubic ? 2 : 1));
      list.neighbours.push_back(static_cast<std::uint8_t>((row > first ? RTC_CURVE_FLAG_NEIGHBOR_LEFT : 0) |
                                                          (row + 1 < last ? RTC_CURVE_FLAG_NEIGHBOR_RIGHT : 0)));
    }
    if (is_cubic) list.balls.push_back(ball_of(scene, last));
  }
  return list;
}

template <class T>
void set_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const std::vector<T>& rows) {
  auto* const buffer = static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), rows.size()));
  std::copy(rows.begin(), rows.end(), buffer);
}

}  // namespace

EmbreeRound::EmbreeRound(const RoundScene& scene, const Options& options)
    : thread_count_(options.thread_count),
      device_(rtcNewDevice(("threads=" + std::to_string(options.thread_count)).c_str())),
      scene_(rtcNewScene(device_)),
      geometry_(rtcNewGeometry(device_, type_of(scene, options.shape))) {
  const EmbreeFloatingPoint mode;
  rtcSetDeviceMemoryMonitorFunction(device_, &EmbreeRound::count_bytes, this);
  if (options.is_refitted) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);  // leaves the choice to the geometry
    rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
  }
  if (scene.has_curves()) {
    write_curves(scene, options.shape);
  } else {
    write_balls(scene);
  }
  rtcAttachGeometry(scene_, geometry_);
  build_seconds_ = commit();
}

EmbreeRound::~EmbreeRound() {
  rtcReleaseGeometry(geometry_);
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

bool EmbreeRound::count_bytes(void* self, ssize_t change, bool) {
  std::atomic_ref(static_cast<EmbreeRound*>(self)->byte_count_).fetch_add(change);
  return true;
}

void EmbreeRound::write_balls(const RoundScene& scene) {
  std::vector<Ball> balls;
  for (std::size_t row = 0; row < scene.centres.size(); ++row) balls.push_back(ball_of(scene, row));
  set_buffer(geometry_, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, balls);
}

void EmbreeRound::write_curves(const RoundScene& scene, EmbreeShape shape) {
  const Segments list = list_segments(scene, shape == EmbreeShape::kCubic);
  set_buffer(geometry_, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, list.balls);
  set_buffer(geometry_, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT, list.firsts);
  if (shape == EmbreeShape::kRound) {
    set_buffer(geometry_, RTC_BUFFER_TYPE_FLAGS, RTC_FORMAT_UCHAR, list.neighbours);
  }
}

double EmbreeRound::commit() {
  const double start = seconds(thread_count_);
  rtcCommitGeometry(geometry_);
  rtcCommitScene(scene_);
  return seconds(thread_count_) - start;
}

double EmbreeRound::move(std::span<const Vec3f> centres) {
  auto* const balls = static_cast<Ball*>(rtcGetGeometryBufferData(geometry_, RTC_BUFFER_TYPE_VERTEX, 0));
  const EmbreeFloatingPoint mode;
  const double start = seconds(thread_count_);
  for (std::size_t row = 0; row < centres.size(); ++row) balls[row].centre = centres[row];
  rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
  const double written = seconds(thread_count_) - start;
  return written + commit();
}

}  // namespace perfect_bvh::bench
