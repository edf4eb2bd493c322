#include "tlas/turns.h"

#include <algorithm>
#include <cmath>

#include "math/elementary.h"

namespace perfect_bvh {
namespace {

double largest_entry(const Affine& map) noexcept {
  double most = 0;
  for (const Vec3d& column : {map.x, map.y, map.z}) {
    most = std::max({most, std::abs(column.x), std::abs(column.y), std::abs(column.z)});
  }
  return most;
}

// Returns the transpose of the inverse.
Affine cofactor_inverse(const Affine& map) noexcept {
  const double scale = 1.0 / map.determinant();
  return {cross(map.y, map.z) * scale, cross(map.z, map.x) * scale, cross(map.x, map.y) * scale, {}};
}

// Finds the rotation, or reflection, nearest to a map: repeatedly takes the mean of the map and the transpose of its
// inverse (Higham 1986, "Computing the polar decomposition").
bool nearest_rotation(Affine& map) noexcept {
  constexpr int kMostRounds = 128;
  for (int round = 0; round < kMostRounds; ++round) {
    const Affine other = cofactor_inverse(map);
    if (!other.is_finite()) return false;
    const Affine mean{(map.x + other.x) * 0.5, (map.y + other.y) * 0.5, (map.z + other.z) * 0.5, {}};
    const double moved = largest_entry({mean.x - map.x, mean.y - map.y, mean.z - map.z, {}});
    map = mean;
    if (moved <= 0x1p-50) return true;
  }
  return false;
}

// Starts from the largest of the four components, to avoid a division by nearly zero (Shepperd 1978).
void to_quaternion(const Affine& turn, double q[4]) noexcept {
  const double trace = turn.x.x + turn.y.y + turn.z.z;
  const double sizes[4] = {trace, turn.x.x, turn.y.y, turn.z.z};
  const auto largest = std::max_element(sizes, sizes + 4) - sizes;
  const double yz = turn.y.z - turn.z.y, zx = turn.z.x - turn.x.z, xy = turn.x.y - turn.y.x;
  const double sum_xy = turn.y.x + turn.x.y, sum_zx = turn.z.x + turn.x.z, sum_yz = turn.z.y + turn.y.z;
  switch (largest) {
    case 0:
      q[0] = 1.0 + trace, q[1] = yz, q[2] = zx, q[3] = xy;
      break;
    case 1:
      q[0] = yz, q[1] = 1.0 + turn.x.x - turn.y.y - turn.z.z, q[2] = sum_xy, q[3] = sum_zx;
      break;
    case 2:
      q[0] = zx, q[1] = sum_xy, q[2] = 1.0 + turn.y.y - turn.x.x - turn.z.z, q[3] = sum_yz;
      break;
    default:
      q[0] = xy, q[1] = sum_zx, q[2] = sum_yz, q[3] = 1.0 + turn.z.z - turn.x.x - turn.y.y;
  }
  const double size = std::sqrt((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]));
  for (int i = 0; i < 4; ++i) q[i] /= size;
}

// Measures the angle between two quaternions. The second is negated if its opposite is nearer.
void measure_turn(TurnStep& from, TurnStep& to) noexcept {
  double* const b = to.rotation;
  const double* const a = from.rotation;
  double cosine = (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
  if (cosine < 0) {
    for (int i = 0; i < 4; ++i) b[i] = -b[i];
    cosine = -cosine;
  }
  double square = 0;
  for (int i = 0; i < 4; ++i) square += (b[i] - cosine * a[i]) * (b[i] - cosine * a[i]);
  from.angle = arc_tangent(std::sqrt(square), cosine);
  constexpr double kSmall = 0x1p-13;  // the straight line then differs by less than a double's rounding
  from.over_sine = from.angle < kSmall ? 0.0 : 1.0 / sine_of_quarter(from.angle);
}

// Decomposes the transform into a step. `before` is the previous step, null for the first. Returns false if it flattens
// space.
bool take_apart(const Affine& transform, TurnStep& step, TurnStep* before) noexcept {
  const double size = largest_entry(transform);
  if (!(size > 0)) return false;
  Affine rotation{transform.x * (1.0 / size), transform.y * (1.0 / size), transform.z * (1.0 / size), {}};
  if (!nearest_rotation(rotation)) return false;
  if (rotation.determinant() < 0) rotation = {-rotation.x, -rotation.y, -rotation.z, {}};
  to_quaternion(rotation, step.rotation);
  const Vec3d columns[3] = {transform.x, transform.y, transform.z};
  for (int i = 0; i < 3; ++i) {
    const Vec3d column = rotation.transposed_vector(columns[i]);
    step.stretch[3 * i] = column.x, step.stretch[3 * i + 1] = column.y, step.stretch[3 * i + 2] = column.z;
    step.translation[i] = transform.translation[i];
  }
  step.angle = step.over_sine = 0.0;
  if (before != nullptr) measure_turn(*before, step);
  return true;
}

Affine stretch_of(const TurnStep& step) noexcept {
  const double* const s = step.stretch;
  return {{s[0], s[1], s[2]}, {s[3], s[4], s[5]}, {s[6], s[7], s[8]}, {}};
}

Affine product(const Affine& a, const Affine& b) noexcept { return {a.vector(b.x), a.vector(b.y), a.vector(b.z), {}}; }
Affine transposed(const Affine& map) noexcept {
  return {{map.x.x, map.y.x, map.z.x}, {map.x.y, map.y.y, map.z.y}, {map.x.z, map.y.z, map.z.z}, {}};
}

// Returns the axis, in its own frame, about which one quaternion turns to the other; zero if it does not turn.
Vec3d axis_between(const double a[4], const double b[4]) noexcept {
  const Vec3d from{a[1], a[2], a[3]}, to{b[1], b[2], b[3]};
  const Vec3d part = to * a[0] - from * b[0] - cross(from, to);
  const double size = length(part);
  return size > 0 ? part * (1.0 / size) : Vec3d{0, 0, 0};
}

void write_map(const Affine& map, double* columns) noexcept {
  for (const Vec3d& column : {map.x, map.y, map.z}) {
    for (int axis = 0; axis < 3; ++axis) *columns++ = column[axis];
  }
}

// `to` equals `from` for the last step.
TurnBack make_back(const TurnStep& from, const TurnStep& to) noexcept {
  TurnBack back{};
  const Affine stretch = stretch_of(from), unstretch = inverse(stretch);
  // Worse ones are inverted in double for each ray; their growth would not be small.
  constexpr double kMostCondition = 0x1p20;
  if (!unstretch.is_finite() || !(largest_entry(unstretch) * largest_entry(stretch) <= kMostCondition)) return back;
  Affine growth = product(inverse(stretch_of(to)), stretch);
  growth.x.x -= 1.0, growth.y.y -= 1.0, growth.z.z -= 1.0;
  if (!(largest_entry(growth) <= kMostGrowth)) return back;
  TurnedPlace turned;
  constexpr double kUnit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  turn(from.rotation, kUnit, turned.columns);
  const double* const c = turned.columns;
  const Affine unturn = transposed({{c[0], c[1], c[2]}, {c[3], c[4], c[5]}, {c[6], c[7], c[8]}, {}});
  const Vec3d k = axis_between(from.rotation, to.rotation);
  const Affine across{{0, -k.z, k.y}, {k.z, 0, -k.x}, {-k.y, k.x, 0}, {}};  // K's transpose: the inverse rotation
  write_map(product(unstretch, unturn), back.maps);
  write_map(product(unstretch, product(across, unturn)), back.maps + 9);
  write_map(product(unstretch, product(across, product(across, unturn))), back.maps + 18);
  constexpr double kNothing = 0x1p-50;  // a double's rounding
  back.grows = largest_entry(growth) > kNothing ? 1 : 0;
  float* entry = back.growth;
  for (const Vec3d& column : {growth.x, growth.y, growth.z}) {
    for (int axis = 0; axis < 3; ++axis) *entry++ = static_cast<float>(column[axis]);
  }
  for (int i = 0; i < 3; ++i) {
    back.translation[i] = from.translation[i], back.shift[i] = to.translation[i] - from.translation[i];
  }
  back.half_angle = &from == &to ? 0.0 : from.angle;
  back.is_ready = 1;
  back.is_mirrored = stretch.determinant() < 0 ? 1 : 0;
  return back;
}

}  // namespace

void Turns::finish() {
  backs.clear();
  for (std::size_t i = 0; i < steps.size(); ++i)
    backs.push_back(make_back(steps[i], steps[std::min(i + 1, steps.size() - 1)]));
}

bool Turns::add(const Affine& transform) {
  TurnStep step;
  if (!take_apart(transform, step, steps.empty() ? nullptr : &steps.back())) return false;
  steps.push_back(step);
  return true;
}

Affine Turns::at(float time) const noexcept {
  TurnedPlace place;
  place_between(steps.data(), moment_at(times, time), place);
  const double *const c = place.columns, *const t = place.translation;
  return {{c[0], c[1], c[2]}, {c[3], c[4], c[5]}, {c[6], c[7], c[8]}, {t[0], t[1], t[2]}};
}

}  // namespace perfect_bvh
