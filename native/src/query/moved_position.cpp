#include "query/moved_position.h"

#include "query/round_list.h"
#include "query/trace.h"

namespace perfect_bvh {
namespace {

Vec3d on_axis(const Instance& instance, const Hit& hit, float time) noexcept {
  const RoundEnds ends = ends_of(round_list(instance.blas->mesh, moment_of(instance, time)), hit.primitive_index);
  const auto centre = [](const RoundBall& ball) { return Vec3d{ball.centre[0], ball.centre[1], ball.centre[2]}; };
  const Vec3d first = centre(ends.first);
  return place_at(instance, time).point(first + (centre(ends.last) - first) * static_cast<double>(hit.u));
}

Vec3d on_triangle(const Instance& instance, const Hit& hit, float time) noexcept {
  const TriangleIndices corners = instance.blas->mesh.triangles[hit.primitive_index];
  return place_triangle(instance, corners, time).at(hit);
}

}  // namespace

Vec3d moved_position(const Instance& instance, const Hit& hit, float from, float to, Vec3d position) noexcept {
  if (instance.motion == 0) return position;
  const auto place = instance.blas->mesh.is_round() ? on_axis : on_triangle;
  return position + (place(instance, hit, to) - place(instance, hit, from));
}

}  // namespace perfect_bvh
