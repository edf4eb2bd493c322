// Rays and hits, as used by all kernels and their callers.
#pragma once

#include <cstdint>
#include <limits>

#include "math/slab.h"
#include "math/triangle.h"
#include "math/vec3.h"

namespace perfect_bvh {

inline constexpr float kInfiniteDistance = std::numeric_limits<float>::infinity();
inline constexpr std::uint32_t kNoHit = 0xFFFFFFFFu;

// Whether rays pass through the backs of triangles. A back is clockwise in world space, as seen from the ray's origin.
enum class Cull : std::uint8_t { kNone, kBack };

// A ray in world space. t is in multiples of the direction's length. A hit counts if t_min <= t <= t_max and t is
// finite as a float.
struct alignas(64) Ray {
  Vec3d origin{0, 0, 0};
  Vec3d direction{0, 0, 0};
  float t_min = 0.0f;
  float t_max = kInfiniteDistance;
  std::uint32_t mask = 0xFFFFFFFFu;  // an instance is seen if it shares a bit
  float time = 0.0f;                 // within the shutter: from 0, its opening, to 1
};
static_assert(sizeof(Ray) == 64);

// A hit, or a miss: then t is infinite and the indices are kNoHit. instance_index is the row in Snapshot::instances.
// The hit point is (1-u-v) v0 + u v1 + v v2 of the triangle.
struct Hit {
  float t = kInfiniteDistance;
  float u = 0.0f;
  float v = 0.0f;
  std::uint32_t instance_index = kNoHit;
  std::uint32_t primitive_index = kNoHit;

  [[nodiscard]] bool found() const noexcept { return instance_index != kNoHit; }
};

// The time of rays for which no time is given.
inline constexpr float kShutterOpens = 0.0f;
// Returns whether a time is valid, that is, from 0 to 1. NaN is not.
[[nodiscard]] static inline bool is_in_shutter(float time) noexcept { return time >= 0.0f && time <= 1.0f; }

// Returns false for rays that can hit nothing: the direction is zero or not finite, the origin is not finite, the t
// range is NaN or crossed, or the time is not valid.
[[nodiscard]] inline bool is_valid(const Ray& ray) noexcept {
  return is_finite(ray.origin) && is_finite(ray.direction) && !(ray.direction == Vec3d{0, 0, 0}) &&
         ray.t_min <= ray.t_max && is_in_shutter(ray.time);
}

// Object ray ----------------------------------------------------------------------------------------------------------
// A world ray as seen by one tree (lecture, "Rigid motion": the ray is transformed, not the geometry).
// The map is applied in double. If the ray begins far from the tree, its origin is moved along it. If its direction is
// very long or very short, it is scaled by a power of two. Only then is the ray narrowed to float:
//   t of the ray = offset + scale * local t
// For most rays the offset is 0 and the scale 1 ("direct"). In the end |origin| <= 4 reach, so the precision of t
// depends on the size of the mesh, not on how far away the ray begins. The start of the ray is kept: whether there is a
// hit is decided for that ray (math/triangle.h).

struct TimeFrame {
  double offset, scale;
  bool is_direct;
};

struct alignas(32) ObjectRay {
  double origin[4], direction[4];  // the fourth is 0
  TimeFrame time;
  double start[3];  // the origin before it was moved; set only if the time is not direct
};

[[nodiscard]] static inline ExactRay exact_ray(const ObjectRay& ray) noexcept {
  return {ray.origin, ray.direction, ray.time.is_direct ? ray.origin : ray.start};
}

// Columns x, y, z, translation; the fourth row is 0.
using MapColumns = double[4][4];

static inline double largest_component(const double v[3]) noexcept {
  const double x = __builtin_fabs(v[0]), y = __builtin_fabs(v[1]), z = __builtin_fabs(v[2]);
  const double xy = x > y ? x : y;
  return xy > z ? xy : z;
}

static inline void map_ray(ObjectRay& out, const ObjectRay& ray, const MapColumns& map) noexcept {
  for (int i = 0; i < 4; ++i) {
    const double linear = (map[0][i] * ray.origin[0] + map[1][i] * ray.origin[1]) + map[2][i] * ray.origin[2];
    out.origin[i] = linear + map[3][i];
    out.direction[i] = (map[0][i] * ray.direction[0] + map[1][i] * ray.direction[1]) + map[2][i] * ray.direction[2];
  }
  out.time = ray.time;
}

// Directions in this range are not scaled. Origins within kNearby times the reach are not moved.
inline constexpr double kShortest = 0x1p-20, kLongest = 0x1p20, kNearby = 4.0;

// Returns true if bring_near() would not change the ray.
static inline bool is_near(const ObjectRay& ray, double reach) noexcept {
  const double longest = largest_component(ray.direction);
  return longest >= kShortest && longest <= kLongest && largest_component(ray.origin) <= kNearby * reach;
}

// Multiplies the ray by `scale`, with the same result as load_ray() and an identity map: no origin component is minus
// zero. Returns false if the ray is not a usual one. In a usual ray, each component of the direction is neither very
// short nor very long, so none is zero (the sign of a zero would depend on the other components), and no component of
// the origin exceeds `farthest`.
static inline bool load_near_by_axis(ObjectRay& out, const Ray& ray, double scale, double farthest) noexcept {
  const double *const origin = &ray.origin.x, *const direction = &ray.direction.x;
  bool is_usual = true;
  for (int axis = 0; axis < 3; ++axis) {
    out.origin[axis] = origin[axis] * scale + 0.0;
    out.direction[axis] = direction[axis] * scale;
    const double length = __builtin_fabs(out.direction[axis]);
    is_usual = is_usual && length >= kShortest && length <= kLongest && __builtin_fabs(out.origin[axis]) <= farthest;
  }
  out.origin[3] = out.direction[3] = 0.0;
  out.time = {0.0, 1.0, true};
  return is_usual;
}

// Moves a ray's origin along its direction to the point of its line that is nearest to the frame's origin, up to
// rounding. Returns a bound of its distance from that point. For origins beyond 2^22 reaches, the move avoids the
// rounding that would be as large as the distance. Up to 2^70 reaches away, the new origin is then less than 2^-29 of a
// reach off the line, which is far less than float rounds (math/slab.h).
static inline double move_near(ObjectRay& ray, double reach) noexcept {
  const double *o = ray.origin, *d = ray.direction;
  const double t = -(o[0] * d[0] + o[1] * d[1] + o[2] * d[2]) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  const double way = __builtin_fabs(t) * largest_component(ray.direction);
  if (way <= 0x1p22 * reach) {
    for (int axis = 0; axis < 3; ++axis) ray.origin[axis] += t * ray.direction[axis];
  } else {
    move_exactly(ray.origin, t, ray.direction);
  }
  ray.time.offset += t * ray.time.scale;
  return 0x1p-48 * way;
}

// Scales an extreme direction, and moves a distant origin towards a tree within `reach` of the frame's origin. Returns
// false if the ray misses that tree, or is too extreme for doubles.
static inline bool bring_near(ObjectRay& ray, double reach) noexcept {
  constexpr double kLargest = 1.7976931348623157e308;
  for (int axis = 0; axis < 3; ++axis) ray.start[axis] = ray.origin[axis];
  const double longest = largest_component(ray.direction);
  if (!(longest >= kShortest && longest <= kLongest)) {
    if (!(longest > 0.0 && longest <= kLargest)) return false;
    const double factor = __builtin_scalbn(1.0, -__builtin_ilogb(longest));
    if (!(factor > 0.0 && factor <= kLargest)) return false;
    for (double& component : ray.direction) component *= factor;
    ray.time.scale *= factor;
    ray.time.is_direct = false;
  }
  constexpr int kMostMoves = 3;  // the second starts within 2^-48 of the distance; the third is for extreme test rays
  for (int moves = 0; !(largest_component(ray.origin) <= kNearby * reach); ++moves) {
    if (moves == kMostMoves) return false;
    ray.time.is_direct = false;
    const double rounding = move_near(ray, reach);
    // If the origin is outside the box's corners, the line misses the box.
    if (!(largest_component(ray.origin) <= 2.0 * reach + rounding)) return false;
  }
  return true;
}

static inline void narrow(const double v[3], float out[3]) noexcept {
  for (int axis = 0; axis < 3; ++axis) out[axis] = static_cast<float>(v[axis]);
}

// Rounds t to a float. Hits reported at the same t are then at the same t, and their order decides.
static inline double to_ray_t(const TimeFrame& time, float local_t) noexcept {
  return static_cast<double>(static_cast<float>(time.offset + time.scale * static_cast<double>(local_t)));
}

// Returns a bound: no greater t rounds to a float of at most t_max. Reported hits are compared with the range again.
static inline double last_t(float t_max) noexcept {
  const double t = static_cast<double>(t_max), last = t + (0x1p-24 * __builtin_fabs(t) + 0x1p-150);
  return last > t ? last : t;  // minus infinity's is NaN
}

// Convert a range of the ray's t to a local range, widened beyond all rounding in between (including underflow to 0). A
// hit outside the local range is outside the range; a hit inside is compared again in the ray's t. Never returns NaN,
// which packets would take as the limit of all their rays: a range that is nowhere, or too far away for a double,
// contains nothing.
static inline float to_local_min(const TimeFrame& time, double t) noexcept {
  if (time.is_direct) return static_cast<float>(t);
  const double exact = (t - (0x1p-22 * __builtin_fabs(t) + 0x1p-149) - time.offset) / time.scale;
  const double least = exact - 0x1p-22 * __builtin_fabs(exact);
  return least == least ? static_cast<float>(least) : __builtin_inff();
}
static inline float to_local_max(const TimeFrame& time, double t) noexcept {
  if (time.is_direct) return static_cast<float>(t);
  const double exact = (t + (0x1p-22 * __builtin_fabs(t) + 0x1p-149) - time.offset) / time.scale;
  const double most = exact + 0x1p-22 * __builtin_fabs(exact);
  return most == most ? static_cast<float>(most) : -__builtin_inff();
}

// Ray state -----------------------------------------------------------------------------------------------------------
// The constants of a ray at one level, as kernels store them.

// For the octant of a ray (bit a: it runs down axis a): the byte offsets in a node of the planes that it hits first and
// last, and 3 * octant.
struct OctantRows {
  std::uint16_t near_row[3], far_row[3];
  std::uint32_t order_shift;
};

// The data that node visits read.
struct BoxState {
  SlabRay slab;
  OctantRows rows;
  float t_min, t_limit;  // local; the limit decreases as hits are found
};
static_assert(sizeof(BoxState) == 60);

// The data that leaf visits read.
struct TriangleState {
  TriangleRay ray;
  std::uint16_t row[4];  // byte offsets in a leaf block of the sheared frame's x, y and z
  DepthRange depths;     // a triangle needs a point in this range to be hit within the limits of t
};

// Widens the range by the amount that a hit's t may be beyond the depths of the triangle's corners.
static inline void set_depths(TriangleState& triangle, float t_min, float t_limit) noexcept {
  const TriangleRay& ray = triangle.ray;
  const float slack = ray.depth_slack;
  const float first = (t_min - slack) * ray.direction_z, last = (t_limit + slack) * ray.direction_z;
  triangle.depths = ray.runs_down ? DepthRange{last, first} : DepthRange{first, last};
}

static constexpr OctantRows octant_rows(std::uint32_t octant) noexcept {
  OctantRows rows{};
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const std::uint32_t runs_down = octant >> axis & 1;
    rows.near_row[axis] = static_cast<std::uint16_t>(64 * axis + 32 * runs_down);
    rows.far_row[axis] = static_cast<std::uint16_t>(64 * axis + 32 - 32 * runs_down);
  }
  rows.order_shift = 3 * octant;
  return rows;
}
static constexpr OctantRows kOctantRows[8] = {octant_rows(0), octant_rows(1), octant_rows(2), octant_rows(3),
                                              octant_rows(4), octant_rows(5), octant_rows(6), octant_rows(7)};

}  // namespace perfect_bvh
