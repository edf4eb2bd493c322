#include "query/round_surface.h"

#include <cmath>

#include "math/curve_joint.h"

namespace perfect_bvh {
namespace {

Vec3d vector_of(const double (&v)[3]) noexcept { return {v[0], v[1], v[2]}; }

// By t; where float cannot tell the chord's ends apart, by what the query said.
bool enters_at(const Chord& chord, const Hit& hit) noexcept {
  if (static_cast<float>(chord.entry) == static_cast<float>(chord.exit)) return hit.v == 0.0f;
  const auto t = static_cast<double>(hit.t);
  return std::abs(chord.entry - t) <= std::abs(chord.exit - t);
}

}  // namespace

RoundPoint RoundPlacer::place(const Instance& instance, const Hit& hit, const Ray& ray) noexcept {
  if (&instance != last_) last_ = &instance, to_object_ = inverse(instance.object_to_world);
  const Mesh& mesh = instance.blas->mesh;
  const RoundList list{mesh.balls.data(), mesh.segments.data(), 1.0f};
  const RoundEnds ends = ends_of(list, hit.primitive_index);
  const Vec3d origin = to_object_.point(ray.origin), direction = to_object_.vector(ray.direction);
  const RoundRay local = round_ray(&origin.x, &direction.x);
  const Chord chord = chord_of_segment(local, ends.first, ends.last);
  const auto t = static_cast<double>(hit.t);
  // Beside the edge of what is seen the map's own rounding decides whether there is a chord.
  const bool has_chord = is_hit(chord);
  const bool is_entry = !has_chord || enters_at(chord, hit);
  const double exact_t = has_chord ? (is_entry ? chord.entry : chord.exit) : t;
  const RoundSurface surface = surface_at(local, ends.first, ends.last, exact_t);
  const Vec3d first = vector_of(ends.first.centre), axis = vector_of(ends.last.centre) - first;
  const double radius = ends.first.radius + surface.u * (ends.last.radius - ends.first.radius);
  const Vec3d normal = vector_of(surface.normal);
  return {instance.object_to_world.point(first + axis * surface.u + normal * radius),
          normalized(to_object_.transposed_vector(normal)), instance.object_to_world.vector(axis), is_entry};
}

}  // namespace perfect_bvh
