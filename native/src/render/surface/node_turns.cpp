// The functions of node_maths.h that rotate vectors.
#include <cmath>

#include "math/elementary.h"
#include "render/surface/node_maths.h"

namespace perfect_bvh {
namespace {

// In the order of kNodeShapes.
enum class Mapping : std::uint8_t { kPoint, kTexture, kVector, kNormal };
enum class Rotation : std::uint8_t { kAxisAngle, kX, kY, kZ, kEuler };

float divided(float a, float b) noexcept { return b != 0.0f ? a / b : 0.0f; }
Vec3f divided(Vec3f a, Vec3f b) noexcept { return {divided(a.x, b.x), divided(a.y, b.y), divided(a.z, b.z)}; }

Vec3f unit(Vec3f v) noexcept {
  const float size = length(v);
  return size > 0.0f ? v * (1.0f / size) : v;
}

struct Turn {
  Vec3f x, y, z;  // columns
  [[nodiscard]] Vec3f of(Vec3f v) const noexcept { return x * v.x + y * v.y + z * v.z; }
  [[nodiscard]] Vec3f back(Vec3f v) const noexcept { return {dot(x, v), dot(y, v), dot(z, v)}; }
};

// Rotates about x, then y, then z.
Turn turn_of(Vec3f angles) noexcept {
  const auto [sx, cx] = sine_cosine(angles.x);
  const auto [sy, cy] = sine_cosine(angles.y);
  const auto [sz, cz] = sine_cosine(angles.z);
  return {{cy * cz, cy * sz, -sy},
          {sy * sx * cz - cx * sz, sy * sx * sz + cx * cz, cy * sx},
          {sy * cx * cz + sx * sz, sy * cx * sz - sx * cz, cy * cx}};
}

Vec3f turned_about(Vec3f v, Vec3f axis, float angle) noexcept {
  const auto [s, c] = sine_cosine(angle);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1.0f - c));
}

}  // namespace

Vec3f node_mapping(std::uint8_t mode, Vec3f v, Vec3f location, Vec3f rotation, Vec3f scale) noexcept {
  const Turn turn = turn_of(rotation);
  switch (static_cast<Mapping>(mode)) {
    case Mapping::kTexture:
      return divided(turn.back(v - location), scale);
    case Mapping::kVector:
      return turn.of(v * scale);
    case Mapping::kNormal:
      return unit(turn.of(divided(v, scale)));
    default:
      return turn.of(v * scale) + location;  // kPoint
  }
}

Vec3f node_vector_rotate(std::uint8_t mode, Vec3f v, Vec3f center, Vec3f axis, float angle, Vec3f rotation,
                         bool inverts) noexcept {
  const auto kind = static_cast<Rotation>(mode);
  const Vec3f arm = v - center;
  if (kind == Rotation::kEuler) {
    const Turn turn = turn_of(rotation);
    return (inverts ? turn.back(arm) : turn.of(arm)) + center;
  }
  if (kind != Rotation::kAxisAngle) {
    axis = {kind == Rotation::kX ? 1.0f : 0.0f, kind == Rotation::kY ? 1.0f : 0.0f, kind == Rotation::kZ ? 1.0f : 0.0f};
  }
  const float size = length(axis);
  return size != 0.0f ? turned_about(arm, axis * (1.0f / size), inverts ? -angle : angle) + center : v;
}

}  // namespace perfect_bvh
