// A thin lens: what lies at one distance is sharp, and points before and behind it spread to the aperture's shape.
// In: a point of [0, 1)^2 for a sample. Out: the point of the lens that the sample's ray passes. Rays through one point
// of the image meet where it is in focus, wherever they pass the lens (Cook, Porter and Carpenter, "Distributed Ray
// Tracing", 1984); the lens has no thickness (Kolb, Mitchell and Hanrahan, "A Realistic Camera Model", 1995, section
// 2).
#pragma once

#include <cmath>
#include <numbers>

#include "math/elementary.h"
#include "render/sampling/directions.h"

namespace perfect_bvh {

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

}  // namespace perfect_bvh
