#include "render/sampling/shutter.h"

#include <algorithm>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

double mix(double from, double to, double share) noexcept { return from + (to - from) * share; }

Turns turns_of(const std::vector<Camera>& cameras) {
  Turns turns;
  turns.times.last = static_cast<std::uint32_t>(cameras.size() - 1);
  turns.times.rate = static_cast<float>(cameras.size() - 1);
  for (const Camera& camera : cameras) {
    if (!turns.add(without_scale(camera.camera_to_world))) {
      throw InvalidArgument("render: a camera's axes lie in one plane; give it a matrix that flattens nothing");
    }
  }
  return turns;
}

}  // namespace

ShutterRays::ShutterRays(const Camera& camera, const std::optional<Shutter>& shutter, int width, int height)
    : camera_(camera), shutter_(shutter), width_(width), height_(height) {
  if (shutter && shutter->cameras.size() > 1) turns_ = turns_of(shutter->cameras);
}

float ShutterRays::open_time(float chance) const noexcept {
  const std::vector<float>& times = shutter_->times;
  if (times.size() < 2) return chance;
  const float at = chance * static_cast<float>(times.size() - 1);
  const std::size_t before = std::min(static_cast<std::size_t>(at), times.size() - 2);
  const float share = at - static_cast<float>(before);
  return times[before] * (1.0f - share) + times[before + 1] * share;
}

// As in Cycles: while a row is seen, which is for a part of the time, the shutter opens and closes; the first row
// begins with the shutter, the last one ends with it.
float ShutterRays::time_at(float chance, int row) const noexcept {
  if (!is_open()) return kShutterOpens;
  float time = open_time(chance);
  if (shutter_->rolling) {
    const float part = *shutter_->rolling;
    const float turn = (static_cast<float>(row) + 1.0f) / static_cast<float>(height_);
    time = part > 0.0f ? (time - 0.5f) * part + (turn - 0.5f) * (1.0f - part) + 0.5f : turn;
  }
  return std::clamp(time, 0.0f, 1.0f);
}

RayMaker ShutterRays::camera_at(float time) const {
  if (!camera_moves()) return {camera_, width_, height_};
  const Moment moment = moment_at(turns_.times, time);
  const std::vector<Camera>& cameras = shutter_->cameras;
  const Camera& from = cameras[moment.step];
  const Camera& to = cameras[std::min<std::size_t>(moment.step + 1, cameras.size() - 1)];
  const auto share = static_cast<double>(moment.later);
  Camera at = camera_;
  at.camera_to_world = turns_.at(time);
  at.left = mix(from.left, to.left, share), at.right = mix(from.right, to.right, share);
  at.bottom = mix(from.bottom, to.bottom, share), at.top = mix(from.top, to.top, share);
  return {at, width_, height_};
}

}  // namespace perfect_bvh
