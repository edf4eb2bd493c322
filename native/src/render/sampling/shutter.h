// The time while the shutter is open: when each sample is taken, and where the camera is then.
// In: how far the shutter opens when, whether it rolls, the camera at some moments. Out: a sample's time, 0 to 1, by
// which everything else of its path is seen, and a camera to cast its ray.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "render/sampling/camera.h"
#include "tlas/turns.h"

namespace perfect_bvh {

struct Shutter {
  // The inverse of the distribution of times, at evenly spaced chances from 0 to 1; empty: all times are alike.
  std::vector<float> times;
  // Rows are seen one after another from the top: for so much of the time each. None: all at once.
  std::optional<float> rolling;
  std::vector<Camera> cameras;  // at evenly spaced moments from 0 to 1; fewer than two: it stands still
  float frame_time = 0.5f;      // when shapes are those that normals were taken of
  bool blurs = true;            // false: all that is seen is of the middle
};

// Of images whose samples have times of their own, what is not blurred shows the middle.
inline constexpr float kShutterMiddle = 0.5f;

class ShutterRays {
 public:
  // The lens, the clipping range and the border are the camera's at all times. Without a shutter, time stands still
  // where it opens. Throws InvalidArgument for a camera with an axis of no length.
  ShutterRays(const Camera& camera, const std::optional<Shutter>& shutter, int width, int height);

  [[nodiscard]] bool is_open() const noexcept { return shutter_.has_value(); }
  [[nodiscard]] bool blurs() const noexcept { return is_open() && shutter_->blurs; }
  [[nodiscard]] float middle() const noexcept { return is_open() ? kShutterMiddle : kShutterOpens; }
  // Of a sample in a row of pixels. chance: from 0 to 1, evenly.
  [[nodiscard]] float time_at(float chance, int row) const noexcept;
  [[nodiscard]] bool camera_moves() const noexcept { return !turns_.steps.empty(); }
  [[nodiscard]] RayMaker camera_at(float time) const;

 private:
  [[nodiscard]] float open_time(float chance) const noexcept;

  Camera camera_;
  std::optional<Shutter> shutter_;
  int width_, height_;
  Turns turns_;  // of the camera, without its scale
};

}  // namespace perfect_bvh
