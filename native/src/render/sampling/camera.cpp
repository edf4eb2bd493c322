#include "render/sampling/camera.h"

#include <algorithm>

#include "core/errors.h"
#include "math/elementary.h"

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

// Uses single precision and truncation, because Blender converts a border to pixels in that way.
int border_edge(float fraction, int size) noexcept {
  return std::clamp(static_cast<int>(fraction * static_cast<float>(size)), 0, size);
}

}  // namespace

Affine without_scale(const Affine& map) {
  return {unit_axis(map.x, "x"), unit_axis(map.y, "y"), unit_axis(map.z, "z"), map.translation};
}

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
      left_(camera.left),
      top_(camera.top),
      angle_x_((camera.right - camera.left) / width),
      angle_y_((camera.top - camera.bottom) / height),
      projection_(camera.projection),
      lens_(camera.lens) {
  step_x_ = right_ * angle_x_;
  step_y_ = up_ * -angle_y_;
  const Vec3d corner = right_ * camera.left + up_ * camera.top;
  corner_ = corner + (orthographic() ? origin_ : axis_);
}

Vec3d RayMaker::towards(double longitude, double latitude) const noexcept {
  const auto [height, flat] = sine_cosine(latitude);
  const auto [aside, ahead] = sine_cosine(longitude);
  return right_ * (flat * aside) + up_ * height + axis_ * (flat * ahead);
}

ImagePoint RayMaker::place_of(Vec3d point) const noexcept {
  const Vec3d way = point - origin_;
  const double aside = dot(way, right_), above = dot(way, up_), ahead = dot(way, axis_);
  const auto place = [&](double x, double y, double depth) {
    return ImagePoint{(x - left_) / angle_x_, (top_ - y) / angle_y_, depth};
  };
  if (orthographic()) return place(aside, above, ahead);
  if (projection_ == Projection::kPerspective) return place(aside / ahead, above / ahead, ahead);
  return place(arc_tangent(aside, ahead), arc_tangent(above, hypotenuse(aside, ahead)), length(way));
}

// A panorama's lens faces each ray; its width is on the side towards the middle of the image, as in Cycles.
void RayMaker::bend(Ray& ray, Point2 on_lens) const noexcept {
  const double x = static_cast<double>(on_lens.x), y = static_cast<double>(on_lens.y);
  if (projection_ != Projection::kEquirectangular) {
    const Vec3d aside = right_ * x + up_ * y;
    ray.origin = ray.origin + aside;
    ray.direction = ray.direction - aside * (1.0 / lens_->focus_distance);
    return;
  }
  const Vec3d inwards = axis_ - ray.direction * dot(axis_, ray.direction);
  const Vec3d wide = dot(inwards, inwards) > 0.0 ? normalized(inwards) : right_;
  const Vec3d aside = wide * x + cross(ray.direction, wide) * y;
  ray.origin = ray.origin + aside;
  ray.direction = normalized(ray.direction * lens_->focus_distance - aside);
}

double RayMaker::pixel_size(Vec3d way) const noexcept {
  const double middle = 0.5 * (angle_x_ + angle_y_), size = length(way), ahead = dot(way, axis_);
  if (orthographic()) return middle;
  if (projection_ != Projection::kPerspective || !(ahead > 0.0)) return middle * size;  // as in the middle of the image
  const Vec3d seen = way * (1.0 / size);
  const auto across = [&](Vec3d step) { return length(step - seen * dot(seen, step)); };
  return 0.5 * (across(step_x_) + across(step_y_)) * ahead;
}

RayMaker::Steps RayMaker::steps_at(const Ray& ray) const noexcept {
  if (projection_ != Projection::kEquirectangular) return {step_x_, step_y_};
  // The derivatives by longitude and latitude; the second has no direction over the poles.
  const Vec3d right = cross(ray.direction, up_);
  return {right * angle_x_, cross(normalized(right), ray.direction) * -angle_y_};
}

// Shutter -------------------------------------------------------------------------------------------------------------

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

// As in Cycles: the shutter opens and closes within the part of the time in which a row is exposed. The first row
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
