// From a pixel to a ray, in world space.
// In: a camera that looks along its own -Z with +Y up, whose every lens setting is folded into a window.
// Out: rays whose direction has unit length along the view axis, so that t IS the depth along that axis: the clipping
// range needs no work a pixel and the depth pass no square root. A panorama has no such axis: there t is the distance,
// which is what Cycles clips by and calls depth, too. Pixel (0, 0) is the top left one; its centre is at (0.5, 0.5), so
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

// A thin lens: what lies at one distance is sharp, and points before and behind it spread to the aperture's shape.
// In: a point of [0, 1)^2 for a sample. Out: the point of the lens that the sample's ray passes. Rays through one point
// of the image meet where it is in focus, wherever they pass the lens (Cook, Porter and Carpenter, "Distributed Ray
// Tracing", 1984); the lens has no thickness (Kolb, Mitchell and Hanrahan, "A Realistic Camera Model", 1995, section
// 2).
struct Lens {
  double radius = 0.0;          // of the aperture's circle, on which a polygon's corners lie; world units
  double focus_distance = 1.0;  // along the view axis, or the ray of a panorama
  int blades = 0;               // corners of the aperture; a circle below 3
  double rotation = 0.0;        // of the corners, in radians from the right upwards
  double ratio = 1.0;           // of height to width: 2 for highlights half as wide as high

  // Evenly over the aperture; x to the right, y upwards.
  [[nodiscard]] Point2 point(Point2 uniform) const noexcept {
    const Point2 disk = uniform_disk(uniform), shape = blades < 3 ? disk : on_polygon(disk);
    return {static_cast<float>(radius / ratio) * shape.x, static_cast<float>(radius) * shape.y};
  }

 private:
  // Moves each sector of the disk evenly onto the triangle between the centre and an edge, so that points which are
  // evenly spread stay it. The middle of the first edge lies where `rotation` points to.
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
  Affine camera_to_world;  // axes of any length: only their directions count
  // The frame: on the plane one unit in front of a perspective camera, in world units for an orthographic one, in
  // radians of longitude (to the right) and latitude (upwards) for an equirectangular one.
  double left = -0.36, right = 0.36, bottom = -0.2025, top = 0.2025;
  Projection projection = Projection::kPerspective;
  float clip_start = 0.1f, clip_end = 1000.0f;  // along the view axis, or the ray of a panorama
  // The part of the frame that is traced, as fractions of it from the lower left corner.
  float border_left = 0.0f, border_right = 1.0f, border_bottom = 0.0f, border_top = 1.0f;
  std::optional<Lens> lens;  // none: as sharp everywhere as through a pinhole
};

struct Pixel {
  std::uint16_t x, y;
};

// Columns [x0, x1) and rows [y0, y1), rows counted from the top.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  [[nodiscard]] constexpr int width() const noexcept { return x1 - x0; }
  [[nodiscard]] constexpr int height() const noexcept { return y1 - y0; }
  [[nodiscard]] constexpr bool contains(int x, int y) const noexcept { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  // With a margin around it, inside a frame.
  [[nodiscard]] constexpr PixelRect grown(int margin, int frame_width, int frame_height) const noexcept {
    return {std::max(x0 - margin, 0), std::max(y0 - margin, 0), std::min(x1 + margin, frame_width),
            std::min(y1 + margin, frame_height)};
  }
  [[nodiscard]] constexpr PixelRect overlap(const PixelRect& other) const noexcept {
    return {std::max(x0, other.x0), std::max(y0, other.y0), std::min(x1, other.x1), std::min(y1, other.y1)};
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return x1 <= x0 || y1 <= y0; }
};

// The pixels inside the camera's border, rounded as Blender rounds them; at least one pixel.
[[nodiscard]] PixelRect border_pixels(const Camera& camera, int width, int height) noexcept;

// The same with axes of length 1. Throws InvalidArgument for one of no length.
[[nodiscard]] Affine without_scale(const Affine& camera_to_world);

// A place in an image: pixels from its upper left corner, and how far in front of the camera.
struct ImagePoint {
  double x, y, depth;
};

// A camera made ready for an image of a certain size.
class RayMaker {
 public:
  // Throws InvalidArgument for a camera with an axis of no length.
  RayMaker(const Camera& camera, int width, int height);

  // Through the image point (x, y), in pixels from the top left corner.
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
  // Where a point of the world is seen: what `through` goes through, the other way round.
  [[nodiscard]] ImagePoint place_of(Vec3d point) const noexcept;

  [[nodiscard]] const std::optional<Lens>& lens() const noexcept { return lens_; }
  // Leads a ray that came `through` the middle of the lens through another point of it: to the same point in focus.
  void bend(Ray& ray, Point2 on_lens) const noexcept;

  [[nodiscard]] Vec3d right() const noexcept { return right_; }
  [[nodiscard]] Vec3d up() const noexcept { return up_; }
  [[nodiscard]] Vec3d axis() const noexcept { return axis_; }  // the way it looks
  // From Cycles' camera space to the world: what lies to the right, above and ahead; of a panorama ahead, to the left
  // and above.
  [[nodiscard]] Affine frame() const noexcept {
    if (projection_ == Projection::kEquirectangular) return {axis_, -right_, up_, origin_};
    return {right_, up_, axis_, origin_};
  }
  // How wide a pixel is that is seen along a way, at its end: across it, in the mean of both sides.
  [[nodiscard]] double pixel_size(Vec3d way) const noexcept;
  // What one pixel to the right or down adds to a ray: to its direction, or to its origin if orthographic.
  struct Steps {
    Vec3d right, down;
  };
  [[nodiscard]] Steps steps_at(const Ray& ray) const noexcept;
  [[nodiscard]] bool orthographic() const noexcept { return projection_ == Projection::kOrthographic; }
  // Of a panorama: in how many pixels it goes round once.
  [[nodiscard]] std::optional<double> round_trip() const noexcept {
    if (projection_ != Projection::kEquirectangular) return std::nullopt;
    return 2.0 * std::numbers::pi / angle_x_;
  }

 private:
  [[nodiscard]] Vec3d towards(double longitude, double latitude) const noexcept;

  Vec3d origin_, right_, up_, axis_;
  Vec3d corner_, step_x_, step_y_;  // directions, or origins if orthographic
  float t_min_, t_max_;
  double left_, top_, angle_x_, angle_y_;  // of a panorama: where it begins, and the size of a pixel
  Projection projection_;
  std::optional<Lens> lens_;
};

// Shutter -------------------------------------------------------------------------------------------------------------
// The time while the shutter is open: when each sample is taken, and where the camera is then.
// In: how far the shutter opens when, whether it rolls, the camera at some moments. Out: a sample's time, 0 to 1, by
// which everything else of its path is seen, and a camera to cast its ray.

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
