// Makes meshes of points and of curves from their balls, and tells by a primitive's number what the caller calls it.
// A point without a radius is left out, and so is a segment between two balls without one: no ray meets them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "math/curve_joint.h"
#include "mesh/primitive_traits.h"

namespace perfect_bvh {

// Balls as callers give them. T: float, or double, which is recentred. One radius alone is that of all balls; none, of
// a mesh that moves: those that it has.
template <class T>
struct BallsGiven {
  std::span<const Vec3<T>> centres;
  std::span<const T> radii;
};

// Each ball is a point. Throws InvalidArgument for numbers that are not finite or exceed 1e18, negative radii, as many
// radii as suit no reading; `function` opens the message.
template <class T>
[[nodiscard]] Mesh make_points(const BallsGiven<T>& balls, const char* function);

// offsets: the first ball of each curve, then how many balls there are; a curve has two balls or more. Throws
// InvalidArgument as make_points() does, for offsets that are not so, and for entries of `cyclic` that are more or
// fewer than the curves. cyclic: one a curve, whether it goes on from its last ball, which must be its first one again;
// empty: none does.
template <class T>
[[nodiscard]] Mesh make_curves(const BallsGiven<T>& balls, std::span<const std::int64_t> offsets, CurveShape shape,
                               const char* function, std::span<const std::uint8_t> cyclic = {});

// Of the same kind, curves of as many balls as there are, from other balls.
template <class T>
[[nodiscard]] Mesh make_again(const Mesh& mesh, const BallsGiven<T>& balls, const char* function);

// Throws InvalidArgument for balls that make_points() would not take.
template <class T>
void check_balls(const BallsGiven<T>& balls, PrimitiveKind kind, const char* function);

// A mesh's curves or points as formulas take them, times `scale`. moment: of one that moves within the shutter.
[[nodiscard]] inline RoundList round_list(const Mesh& mesh, const Moment& moment = {}, float scale = 1.0f) noexcept {
  RoundList list{mesh.at_step(moment.step).balls.data(), mesh.segments.data(), scale, mesh.shape};
  list.closed = mesh.closed.data(), list.closed_count = mesh.closed.size();
  if (moment.is_between()) list.later = mesh.at_step(moment.step + 1).balls.data(), list.moment = moment;
  return list;
}

// The ball in row i of what was given.
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
