// Makes meshes of points and of curves from their spheres, and translates a primitive's number to the caller's.
// A point without a radius is omitted, and so is a segment between two spheres without one: no ray hits them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "math/curve_joint.h"
#include "mesh/primitive_traits.h"

namespace perfect_bvh {

// Spheres as callers give them. T: float, or double, which is recentred. A single radius applies to all spheres. No
// radii, for a moving mesh: the radii stay.
template <class T>
struct BallsGiven {
  std::span<const Vec3<T>> centres;
  std::span<const T> radii;
};

// Makes each sphere a point. Throws InvalidArgument for numbers that are not finite or exceed 1e18, negative radii, or
// a wrong number of radii; `function` opens the message.
template <class T>
[[nodiscard]] Mesh make_points(const BallsGiven<T>& balls, const char* function);

// offsets: the first sphere of each curve, then the number of spheres; a curve has two spheres or more. cyclic: one per
// curve, whether it continues from its last sphere, which must equal its first one; empty: no curve does. Throws
// InvalidArgument as make_points() does, for invalid offsets, and if `cyclic` does not have one entry per curve.
template <class T>
[[nodiscard]] Mesh make_curves(const BallsGiven<T>& balls, std::span<const std::int64_t> offsets, CurveShape shape,
                               const char* function, std::span<const std::uint8_t> cyclic = {});

// Makes a mesh of the same kind from other spheres; curves keep their number of spheres.
template <class T>
[[nodiscard]] Mesh make_again(const Mesh& mesh, const BallsGiven<T>& balls, const char* function);

// Throws InvalidArgument for spheres that make_points() would reject.
template <class T>
void check_balls(const BallsGiven<T>& balls, PrimitiveKind kind, const char* function);

// Returns a mesh's curves or points in the form that the formulas use, times `scale`. moment: for a mesh that moves
// within the shutter.
[[nodiscard]] inline RoundList round_list(const Mesh& mesh, const Moment& moment = {}, float scale = 1.0f) noexcept {
  RoundList list{mesh.at_step(moment.step).balls.data(), mesh.segments.data(), scale, mesh.shape};
  list.closed = mesh.closed.data(), list.closed_count = mesh.closed.size();
  if (moment.is_between()) list.later = mesh.at_step(moment.step + 1).balls.data(), list.moment = moment;
  return list;
}

// Returns the sphere in row i of the input.
template <class T>
[[nodiscard]] inline Ball ball_at(const BallsGiven<T>& balls, std::size_t i, Vec3d centre) noexcept {
  const T radius = balls.radii[balls.radii.size() == 1 ? 0 : i];
  if constexpr (sizeof(T) == sizeof(float)) {
    return {balls.centres[i], radius};
  } else {
    return {to_float(balls.centres[i] - centre), static_cast<float>(radius)};
  }
}

}  // namespace perfect_bvh
