#include "render/camera.h"

#include <algorithm>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

Vec3d unit_axis(Vec3d axis, const char* name) {
  const double size = length(axis);
  if (!(size > 0.0) || !std::isfinite(size)) {
    throw InvalidArgument(std::string("render: the camera's matrix has no usable ") + name +
                          " axis (its length must be positive and finite); give it a scale other than zero");
  }
  return axis * (1.0 / size);
}

// Single precision and truncation, because that is how Blender turns a border into pixels.
int border_edge(float fraction, int size) noexcept {
  return std::clamp(static_cast<int>(fraction * static_cast<float>(size)), 0, size);
}

}  // namespace

PixelRect border_pixels(const Camera& camera, int width, int height) noexcept {
  PixelRect rect;
  rect.x0 = std::min(border_edge(camera.border_left, width), width - 1);
  rect.x1 = std::max(border_edge(camera.border_right, width), rect.x0 + 1);
  const int low = std::min(border_edge(camera.border_bottom, height), height - 1);
  const int high = std::max(border_edge(camera.border_top, height), low + 1);
  rect.y0 = height - high;
  rect.y1 = height - low;
  return rect;
}

RayMaker::RayMaker(const Camera& camera, int width, int height)
    : origin_(camera.camera_to_world.translation),
      right_(unit_axis(camera.camera_to_world.x, "x")),
      up_(unit_axis(camera.camera_to_world.y, "y")),
      axis_(-unit_axis(camera.camera_to_world.z, "z")),
      t_min_(camera.clip_start),
      t_max_(camera.clip_end),
      orthographic_(camera.projection == Projection::kOrthographic) {
  step_x_ = right_ * ((camera.right - camera.left) / width);
  step_y_ = up_ * ((camera.bottom - camera.top) / height);
  const Vec3d corner = right_ * camera.left + up_ * camera.top;
  pixel_size_ = static_cast<float>(std::max(length(step_x_), length(step_y_)));
  corner_ = corner + (orthographic_ ? origin_ : axis_);
}

}  // namespace perfect_bvh
