// Makes meshes of points and of curves from their balls, and tells by a primitive's number what the caller calls it.
// A point without a radius is left out, and so is a segment between two balls without one: no ray meets them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "mesh/mesh.h"

namespace perfect_bvh {

// Balls as callers give them. T: float, or double, which is recentred. One radius alone is that of all balls; none, of
// a mesh that moves: those that it has.
template <class T>
struct BallsGiven {
  std::span<const Vec3<T>> centres;
  std::span<const T> radii;
};

// What messages call the centres, after what the caller calls them: "centers" of points, "points" of curves.
[[nodiscard]] const char* name_of_centres(PrimitiveKind kind) noexcept;

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

// Throws InvalidArgument for balls that make_points() would not take.
template <class T>
void check_balls(const BallsGiven<T>& balls, PrimitiveKind kind, const char* function);

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

// How many balls the caller gave, those included that are left out.
[[nodiscard]] std::size_t given_ball_count(const Mesh& mesh) noexcept;
// How many curves or points the caller gave.
[[nodiscard]] std::size_t given_part_count(const Mesh& mesh) noexcept;
// How many points or segments were left out.
[[nodiscard]] std::size_t left_out_count(const Mesh& mesh) noexcept;

// The number that the caller knows the point or the segment's curve by; of a triangle its own.
[[nodiscard]] std::uint32_t caller_number(const Mesh& mesh, std::uint32_t primitive) noexcept;
// What a hit's u along its segment is along the whole curve, 0 to 1; 0 of a point, the same of a triangle.
[[nodiscard]] float u_along_curve(const Mesh& mesh, std::uint32_t primitive, float u) noexcept;

}  // namespace perfect_bvh
