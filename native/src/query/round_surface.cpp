#include "query/round_surface.h"

#include <algorithm>
#include <cmath>

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

// Round surface -------------------------------------------------------------------------------------------------------

namespace {

Vec3d vector_of(const double (&v)[3]) noexcept { return {v[0], v[1], v[2]}; }

// Decides by t. If float cannot distinguish the chord's ends, uses the query's answer.
bool enters_at(const Chord& chord, const Hit& hit) noexcept {
  if (static_cast<float>(chord.entry) == static_cast<float>(chord.exit)) return hit.v == 0.0f;
  const auto t = static_cast<double>(hit.t);
  return std::abs(chord.entry - t) <= std::abs(chord.exit - t);
}

Vec3d axis_of(const RoundList& list, std::uint32_t primitive) noexcept {
  const RoundEnds ends = ends_of(list, primitive);
  return vector_of(ends.last.centre) - vector_of(ends.first.centre);
}

// Returns the curve's direction there. It interpolates between the ends; at each end it is the mean of the segments
// before and after it.
Vec3d tangent_at(const RoundList& list, std::uint32_t primitive, double u) noexcept {
  const Vec3d own = axis_of(list, primitive);
  const auto axis_beside = [&](Along way) {
    const std::uint32_t other = neighbour_of(list, primitive, way);
    return other == kNoSegment ? own : axis_of(list, other);
  };
  const Vec3d before = axis_beside(Along::kBefore), after = axis_beside(Along::kAfter);
  return own + before + (after - before) * u;
}

// The distance off a curve at which secondary rays start, as a fraction of the largest coordinate: more than rounding
// may move it.
constexpr double kClear = 0x1p-40;

// Extends the exit by a neighbour's chord, if the chord continues where this one ends.
bool goes_on_in(const RoundRay& ray, const RoundList& list, std::uint32_t segment, double& exit) noexcept {
  const Chord chord = chord_of(ray, list, segment);
  if (!(chord.entry <= exit && chord.exit > exit)) return false;
  exit = chord.exit;
  return true;
}

}  // namespace

Vec3d leave_curve(const Instance& instance, std::uint32_t segment, Vec3d origin, Vec3d direction, float time) {
  const Affine to_world = place_at(instance, time), to_object = inverse(to_world);
  const Vec3d start = to_object.point(origin), way = to_object.vector(direction);
  const RoundRay ray = round_ray(&start.x, &way.x);
  const Mesh& mesh = instance.blas->mesh;
  const RoundList list = round_list(mesh, moment_of(instance, time));
  double exit = std::max(chord_of(ray, list, segment).exit, 0.0);
  for (std::size_t left = mesh.segments.size(); left > 0; --left) {
    const std::uint32_t after = neighbour_of(list, segment, Along::kAfter);
    const std::uint32_t before = neighbour_of(list, segment, Along::kBefore);
    if (after != kNoSegment && goes_on_in(ray, list, after, exit)) {
      segment = after;
    } else if (before != kNoSegment && goes_on_in(ray, list, before, exit)) {
      segment = before;
    } else {
      break;
    }
  }
  const RoundEnds ends = ends_of(list, segment);
  const Vec3d normal = vector_of(surface_at(ray, ends.first, ends.last, exit).normal);
  const Vec3d point = to_world.point(start + way * exit);
  const auto largest = [](Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); };
  const double clear = kClear * (largest(point) + largest(to_world.translation));
  return point + normalized(to_object.transposed_vector(normal)) * clear;
}

RoundPoint RoundPlacer::place(const Instance& instance, const Hit& hit, const Ray& ray) noexcept {
  if (&instance != last_) last_ = &instance, to_object_ = inverse(instance.object_to_world);
  const Mesh& mesh = instance.blas->mesh;
  const RoundList list = round_list(mesh, moment_of(instance, ray.time));
  const RoundEnds ends = ends_of(list, hit.primitive_index);
  const Vec3d origin = to_object_.point(ray.origin), direction = to_object_.vector(ray.direction);
  const RoundRay local = round_ray(&origin.x, &direction.x);
  if (mesh.shape == CurveShape::kRibbon) {
    return place_ribbon(instance, list, hit.primitive_index, local);
  }
  const Chord chord = chord_of_segment(local, ends.first, ends.last);
  const auto t = static_cast<double>(hit.t);
  // Near the silhouette, the map's own rounding decides whether there is a chord.
  const bool has_chord = is_hit(chord);
  const bool is_entry = !has_chord || enters_at(chord, hit);
  const double exact_t = has_chord ? (is_entry ? chord.entry : chord.exit) : t;
  const RoundSurface surface = surface_at(local, ends.first, ends.last, exact_t);
  const Vec3d first = vector_of(ends.first.centre), axis = vector_of(ends.last.centre) - first;
  const double radius = ends.first.radius + surface.u * (ends.last.radius - ends.first.radius);
  const Vec3d normal = vector_of(surface.normal);
  const Vec3d position = instance.object_to_world.point(first + axis * surface.u + normal * radius);
  return {position, normalized(to_object_.transposed_vector(normal)), instance.object_to_world.vector(axis), is_entry};
}

RoundPoint RoundPlacer::place_ribbon(const Instance& instance, const RoundList& list, std::uint32_t primitive,
                                     const RoundRay& local) const noexcept {
  const Affine& to_world = instance.object_to_world;
  const RoundEnds ends = ends_of(list, primitive);
  const RibbonPlace place = place_on_ribbon(local, ends.first, ends.last);
  const double radius = radius_at(ends.first, ends.last, place.u);
  const Vec3d first = vector_of(ends.first.centre), axis = vector_of(ends.last.centre) - first;
  const Vec3d centre = first + axis * place.u, away = vector_of(place.away);
  const Vec3d tangent = tangent_at(list, primitive, place.u);
  const double share = radius > 0.0 ? std::sqrt(place.squared) / radius : 0.0;
  Vec3d normal;
  ribbon_normal(local.direction, &tangent.x, place.away, share, &normal.x);
  return {to_world.point(centre + away), normalized(to_object_.transposed_vector(normal)), to_world.vector(axis), true,
          radius * length(to_world.vector(normalized(cross(vector_of(local.direction), axis))))};
}

}  // namespace perfect_bvh
