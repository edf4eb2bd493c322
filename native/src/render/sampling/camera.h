// Converts a pixel to a ray, in world space.
// In: a camera that looks along its own -Z with +Y up, with all lens settings combined into a window.
// Out: rays whose direction has unit length along the view axis, so that t IS the depth along that axis: the clipping
// range needs no work per pixel, and the depth pass no square root. A panorama has no such axis: its t is the distance,
// by which Cycles clips and which it also calls depth. Pixel (0, 0) is at the top left; its centre is at (0.5, 0.5), so
// that the pixels divide the window evenly.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "math/aabb.h"
#include "math/elementary.h"
#include "render/sampling/sampler.h"
#include "tlas/turns.h"
#include "traverse/ray.h"

namespace perfect_bvh {

enum class Projection : std::uint8_t { kPerspective, kOrthographic, kEquirectangular };

// A thin lens: points at one distance are sharp, and points in front and behind are blurred to the aperture's shape.
// In: a point of [0, 1)^2 for a sample. Out: the point of the lens for the sample's ray. Rays through one point of the
// image meet at the focus distance, for any point where they pass the lens (Cook, Porter and Carpenter, "Distributed
// Ray Tracing", 1984). The lens has no thickness (Kolb, Mitchell and Hanrahan, "A Realistic Camera Model", 1995,
// section 2).
struct Lens {
  double radius = 0.0;          // of the aperture's circle, through a polygon's corners; world units
  double focus_distance = 1.0;  // along the view axis, or the ray of a panorama
  int blades = 0;               // corners of the aperture; a circle below 3
  double rotation = 0.0;        // of the corners, in radians from the right upwards
  double ratio = 1.0;           // of height to width: 2 for highlights half as wide as high

  // Returns a uniform point of the aperture; x to the right, y upwards.
  [[nodiscard]] Point2 point(Point2 uniform) const noexcept {
    const Point2 disk = uniform_disk(uniform), shape = blades < 3 ? disk : on_polygon(disk);
    return {static_cast<float>(radius / ratio) * shape.x, static_cast<float>(radius) * shape.y};
  }

 private:
  // Maps each sector of the disk to the triangle between the centre and an edge, so that uniform points stay uniform.
  // `rotation` points to the middle of the first edge.
  [[nodiscard]] Point2 on_polygon(Point2 disk) const noexcept {
    const double sector = 2.0 * std::numbers::pi / blades;
    const double turns = arc_tangent(static_cast<double>(disk.y), static_cast<double>(disk.x)) / sector;
    const double edge = std::round(turns),
                 outwards = hypotenuse(static_cast<double>(disk.x), static_cast<double>(disk.y));
    const auto half = sine_cosine(sector / 2.0);
    const double x = outwards * half.cosine, y = outwards * half.sine * 2.0 * (turns - edge);
    const auto [sine, cosine] = sine_cosine(rotation + edge * sector);
    return {static_cast<float>(cosine * x - sine * y), static_cast<float>(sine * x + cosine * y)};
  }
};

struct Camera {
  Affine camera_to_world;  // axes of any length: only their directions matter
  // The frame: on the plane one unit in front of a perspective camera, in world units for an orthographic one, in
  // radians of longitude (to the right) and latitude (upwards) for an equirectangular one.
  double left = -0.36, right = 0.36, bottom = -0.2025, top = 0.2025;
  Projection projection = Projection::kPerspective;
  float clip_start = 0.1f, clip_end = 1000.0f;  // along the view axis, or the ray of a panorama
  // The part of the frame that is traced, as fractions of it from the lower left corner.
  float border_left = 0.0f, border_right = 1.0f, border_bottom = 0.0f, border_top = 1.0f;
  std::optional<Lens> lens;  // empty: sharp everywhere, as with a pinhole
};

struct Pixel {
  std::uint16_t x, y;
};

// Columns [x0, x1) and rows [y0, y1), with rows counted from the top.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  [[nodiscard]] constexpr int width() const noexcept { return x1 - x0; }
  [[nodiscard]] constexpr int height() const noexcept { return y1 - y0; }
  [[nodiscard]] constexpr bool contains(int x, int y) const noexcept { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  // Returns the rectangle with a margin around it, clipped to a frame.
  [[nodiscard]] constexpr PixelRect grown(int margin, int frame_width, int frame_height) const noexcept {
    return {std::max(x0 - margin, 0), std::max(y0 - margin, 0), std::min(x1 + margin, frame_width),
            std::min(y1 + margin, frame_height)};
  }
  [[nodiscard]] constexpr PixelRect overlap(const PixelRect& other) const noexcept {
    return {std::max(x0, other.x0), std::max(y0, other.y0), std::min(x1, other.x1), std::min(y1, other.y1)};
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return x1 <= x0 || y1 <= y0; }
};

// Returns the pixels inside the camera's border, rounded as in Blender; at least one pixel.
[[nodiscard]] PixelRect border_pixels(const Camera& camera, int width, int height) noexcept;

// Returns the matrix with axes of length 1. Throws InvalidArgument for an axis of length 0.
[[nodiscard]] Affine without_scale(const Affine& camera_to_world);

// A position in an image: pixels from its upper left corner, and the depth in front of the camera.
struct ImagePoint {
  double x, y, depth;
};

// A camera prepared for an image of a certain size.
class RayMaker {
 public:
  // Throws InvalidArgument for a camera with an axis of length 0.
  RayMaker(const Camera& camera, int width, int height);

  // Returns the ray through the image point (x, y), in pixels from the top left corner.
  [[nodiscard]] Ray through(double x, double y, std::uint32_t mask, float time = kShutterOpens) const noexcept {
    Ray ray;
    if (projection_ == Projection::kEquirectangular) {
      ray.origin = origin_;
      ray.direction = towards(left_ + angle_x_ * x, top_ - angle_y_ * y);
    } else {
      const Vec3d offset = step_x_ * x + step_y_ * y;
      ray.origin = orthographic() ? corner_ + offset : origin_;
      ray.direction = orthographic() ? axis_ : corner_ + offset;
    }
    ray.t_min = t_min_;
    ray.t_max = t_max_;
    ray.mask = mask;
    ray.time = time;
    return ray;
  }
  // Returns where a world point is seen: the inverse of `through`.
  [[nodiscard]] ImagePoint place_of(Vec3d point) const noexcept;

  [[nodiscard]] const std::optional<Lens>& lens() const noexcept { return lens_; }
  // Bends a ray that came `through` the middle of the lens to pass another point of it, towards the same point in
  // focus.
  void bend(Ray& ray, Point2 on_lens) const noexcept;

  [[nodiscard]] Vec3d right() const noexcept { return right_; }
  [[nodiscard]] Vec3d up() const noexcept { return up_; }
  [[nodiscard]] Vec3d axis() const noexcept { return axis_; }  // the viewing direction
  // Maps Cycles' camera space to the world: right, up and ahead; for a panorama ahead, left and up.
  [[nodiscard]] Affine frame() const noexcept {
    if (projection_ == Projection::kEquirectangular) return {axis_, -right_, up_, origin_};
    return {right_, up_, axis_, origin_};
  }
  // Returns the width of a pixel, seen along a vector, at its end: perpendicular to it, the mean of both sides.
  [[nodiscard]] double pixel_size(Vec3d way) const noexcept;
  // The change of a ray from one pixel to the right or down: of its direction, or of its origin if orthographic.
  struct Steps {
    Vec3d right, down;
  };
  [[nodiscard]] Steps steps_at(const Ray& ray) const noexcept;
  [[nodiscard]] bool orthographic() const noexcept { return projection_ == Projection::kOrthographic; }
  // For a panorama: the number of pixels of a full turn.
  [[nodiscard]] std::optional<double> round_trip() const noexcept {
    if (projection_ != Projection::kEquirectangular) return std::nullopt;
    return 2.0 * std::numbers::pi / angle_x_;
  }

 private:
  [[nodiscard]] Vec3d towards(double longitude, double latitude) const noexcept;

  Vec3d origin_, right_, up_, axis_;
  Vec3d corner_, step_x_, step_y_;  // directions, or origins if orthographic
  float t_min_, t_max_;
  double left_, top_, angle_x_, angle_y_;  // of a panorama: its start, and the size of a pixel
  Projection projection_;
  std::optional<Lens> lens_;
};

// Shutter -------------------------------------------------------------------------------------------------------------
// The time while the shutter is open: the time of each sample, and the camera at that time.
// In: how far the shutter opens over time, whether it rolls, the camera at some moments. Out: a sample's time, 0 to 1,
// which its whole path uses, and a camera to cast its ray.
// which everything else of its path is seen, and a camera to cast its ray.

struct Shutter {
  // The inverse of the distribution of times, at evenly spaced probabilities from 0 to 1; empty: uniform.
  std::vector<float> times;
  // Rows are exposed one after another from the top, each for this share of the time. Empty: all at once.
  std::optional<float> rolling;
  std::vector<Camera> cameras;  // at evenly spaced moments from 0 to 1; fewer than two: it does not move
  float frame_time = 0.5f;      // the time of the shapes to which normals belong
  bool blurs = true;            // false: everything is seen in the middle
};

// If samples have their own times, passes without blur show the middle.
inline constexpr float kShutterMiddle = 0.5f;

class ShutterRays {
 public:
  // The lens, the clipping range and the border are the camera's at all times. Without a shutter, all samples have the
  // time at which it opens. Throws InvalidArgument for a camera with an axis of length 0.
  ShutterRays(const Camera& camera, const std::optional<Shutter>& shutter, int width, int height);

  [[nodiscard]] bool is_open() const noexcept { return shutter_.has_value(); }
  [[nodiscard]] bool blurs() const noexcept { return is_open() && shutter_->blurs; }
  [[nodiscard]] float middle() const noexcept { return is_open() ? kShutterMiddle : kShutterOpens; }
  // Returns the time of a sample in a row of pixels. chance: from 0 to 1, uniform.
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
