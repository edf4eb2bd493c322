// Eight lanes in plain C++, for any machine: the same bits as the vector versions, lane by lane.
// Included by one translation unit only; everything in it has internal linkage.
#pragma once

#include <cstdint>
#include <cstring>

#include "traverse/ray.h"
#include "traverse/scene_view.h"
#include "wide/wide_bvh.h"

namespace perfect_bvh {
namespace {

#define PERFECT_BVH_INLINE inline

struct Float8 {
  float lane[8];
};
struct Int8 {
  std::uint32_t lane[8];
};
using Mask8 = unsigned;

template <class Lane>
inline Float8 each(Lane&& lane) noexcept {
  Float8 result;
  for (int i = 0; i < 8; ++i) result.lane[i] = lane(i);
  return result;
}
template <class Lane>
inline Mask8 each_bit(Lane&& lane) noexcept {
  Mask8 result = 0;
  for (int i = 0; i < 8; ++i) result |= (lane(i) ? 1u : 0u) << i;
  return result;
}

inline Float8 load_row(const void* base, std::size_t byte_offset) noexcept {
  Float8 result;
  std::memcpy(result.lane, static_cast<const char*>(base) + byte_offset, sizeof(result.lane));
  return result;
}
inline Float8 load(const float* p) noexcept { return load_row(p, 0); }
inline Int8 load(const std::uint32_t* p) noexcept {
  Int8 result;
  std::memcpy(result.lane, p, sizeof(result.lane));
  return result;
}
inline void store(float* p, const Float8& a) noexcept { std::memcpy(p, a.lane, sizeof(a.lane)); }
inline Float8 broadcast(const float& x) noexcept {
  return each([x](int) { return x; });
}
inline Float8 zero() noexcept { return broadcast(0.0f); }
inline Float8 add(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] + b.lane[i]; });
}
inline Float8 sub(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] - b.lane[i]; });
}
inline Float8 mul(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] * b.lane[i]; });
}
inline Float8 div(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] / b.lane[i]; });
}
inline Float8 fmadd(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return each([&](int i) { return __builtin_fmaf(a.lane[i], b.lane[i], c.lane[i]); });
}
inline Float8 fmsub(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return each([&](int i) { return __builtin_fmaf(a.lane[i], b.lane[i], -c.lane[i]); });
}
inline Float8 fnmadd(const Float8& a, const Float8& b, const Float8& c) noexcept {
  return each([&](int i) { return __builtin_fmaf(-a.lane[i], b.lane[i], c.lane[i]); });
}
// Of two equal or unordered values, the second is returned, as on x86.
inline Float8 min(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Float8 max(const Float8& a, const Float8& b) noexcept {
  return each([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Float8 abs(const Float8& a) noexcept {
  return each([&](int i) { return __builtin_fabsf(a.lane[i]); });
}

// Returns t where a ray hits eight planes across an axis. `inverse` and `offset` are those of a SlabRay: a fourth float
// after the three may be read.
template <int kAxis>
inline Float8 plane_depths(const Float8& planes, const float* inverse, const float* offset) noexcept {
  return fmsub(planes, broadcast(inverse[kAxis]), broadcast(offset[kAxis]));
}

inline Mask8 less_equal(const Float8& a, const Float8& b) noexcept {
  return each_bit([&](int i) { return a.lane[i] <= b.lane[i]; });
}
inline Mask8 less(const Float8& a, const Float8& b) noexcept {
  return each_bit([&](int i) { return a.lane[i] < b.lane[i]; });
}
inline Mask8 not_equal(const Float8& a, const Float8& b) noexcept {
  return each_bit([&](int i) { return a.lane[i] < b.lane[i] || a.lane[i] > b.lane[i]; });  // ordered
}
inline Mask8 both(Mask8 a, Mask8 b) noexcept { return a & b; }
inline Mask8 either(Mask8 a, Mask8 b) noexcept { return a | b; }
inline unsigned bits(Mask8 mask) noexcept { return mask; }
inline unsigned count_bits(unsigned mask) noexcept { return static_cast<unsigned>(__builtin_popcount(mask)); }
// Returns the lanes of a leaf block that repeat the previous triangle.
inline unsigned repeated_lanes(const std::uint32_t* primitives) noexcept {
  return each_bit([&](int i) { return i > 0 && primitives[i] == primitives[i - 1]; });
}

template <int kCount>
inline Int8 shift_right(const Int8& a) noexcept {
  Int8 result;
  for (int i = 0; i < 8; ++i) result.lane[i] = a.lane[i] >> kCount;
  return result;
}
// Returns bits 10 kPlace to 10 kPlace + 9 of each word, as floats.
template <int kPlace>
inline Float8 ten_bits(const Int8& words) noexcept {
  return each([&](int i) { return static_cast<float>(words.lane[i] >> (10 * kPlace) & 0x3FFu); });
}
inline Float8 load_small(const std::uint8_t* p) noexcept {
  return each([&](int i) { return static_cast<float>(p[i]); });
}
// Lane i becomes a[index[i] & 7].
inline Float8 permute(const Float8& a, const Int8& index) noexcept {
  return each([&](int i) { return a.lane[index.lane[i] & 7]; });
}

// Writes the children in `hit` to `children`, the farthest first, and their entry distances to `nears`. Returns their
// number.
inline unsigned push_sorted(const WideNode& node, std::uint32_t order_shift, Mask8 hit, const Float8& near,
                            std::uint32_t* children, float* nears) noexcept {
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t place = (node.order[i] >> order_shift) & 7;
    if ((hit >> place & 1) == 0) continue;
    *children++ = node.child[place];
    *nears++ = near.lane[place];
  }
  return count_bits(hit);
}
inline unsigned push_unsorted(const WideNode& node, Mask8 hit, std::uint32_t* children) noexcept {
  for (unsigned i = 0; i < 8; ++i) {
    if (hit >> i & 1) *children++ = node.child[i];
  }
  return count_bits(hit);
}
// Moves the first `count` (at most 8) entries whose `nears` do not exceed `limit` to the front of `to_*`, which may be
// the same array or begin before it. Returns the number of entries kept.
inline unsigned keep_near(const std::uint32_t* children, const float* nears, unsigned count, const Float8& limit,
                          std::uint32_t* to_children, float* to_nears) noexcept {
  unsigned kept = 0;
  for (unsigned i = 0; i < count; ++i) {
    if (!(nears[i] <= limit.lane[0])) continue;
    to_children[kept] = children[i];
    to_nears[kept++] = nears[i];
  }
  return kept;
}

// Ray setup scalar ----------------------------------------------------------------------------------------------------
// Computes the constants of a level from a ray in double, in plain C++. The vector version gives the same bits.
// Included by translation units of kernels only; everything in it has internal linkage.

// Multiplies the ray by `scale`. Returns false if its origin is not finite (bring_near checks directions later).
inline bool load_ray(ObjectRay& out, const Ray& ray, double scale) noexcept {
  const double* const origin = &ray.origin.x;
  const double* const direction = &ray.direction.x;
  bool is_finite = true;
  for (int axis = 0; axis < 3; ++axis) {
    is_finite = is_finite && origin[axis] - origin[axis] == 0.0;
    out.origin[axis] = origin[axis] * scale;
    out.direction[axis] = direction[axis] * scale;
  }
  out.origin[3] = out.direction[3] = 0.0;
  out.time = {0.0, 1.0, true};
  return is_finite;
}

inline bool load_near(ObjectRay& out, const Ray& ray, double scale, double farthest) noexcept {
  return load_near_by_axis(out, ray, scale, farthest);
}

inline void map_to_local(ObjectRay& out, const ObjectRay& ray, const MapColumns& map) noexcept {
  map_ray(out, ray, map);
}
inline bool stands_near(const ObjectRay& ray, double reach) noexcept { return is_near(ray, reach); }

// Sets everything except the limits of t. The ray must be near.
inline void set_states(BoxState& box, TriangleState& triangle, const ObjectRay& ray,
                       const TreeExtent& extent) noexcept {
  float origin[3], direction[3];
  narrow(ray.origin, origin);
  narrow(ray.direction, direction);
  const int longest = longest_axis(direction);
  set_slab_ray(box.slab, origin, direction, longest, extent);
  std::uint32_t octant = 0;
  for (int axis = 0; axis < 3; ++axis) octant |= (box.slab.inverse[axis] < 0.0f ? 1u : 0u) << axis;
  box.rows = kOctantRows[octant];
  set_triangle_ray(triangle.ray, origin, direction, longest, extent);
  for (int i = 0; i < 3; ++i) triangle.row[i] = static_cast<std::uint16_t>(32 * triangle.ray.axes[i]);
}

// Gather scalar -------------------------------------------------------------------------------------------------------
// Reads spheres, in plain C++.
// Included by one translation unit only; everything in it has internal linkage.

// `ball(lane)` returns the sphere of that lane.
template <class BallOf>
inline void gather_balls(float (*rows)[8], float scale, const BallOf& ball) noexcept {
  for (int lane = 0; lane < 8; ++lane) {
    const Ball& from = ball(lane);
    rows[0][lane] = from.centre.x * scale, rows[1][lane] = from.centre.y * scale;
    rows[2][lane] = from.centre.z * scale, rows[3][lane] = from.radius * scale;
  }
}

}  // namespace

}  // namespace perfect_bvh
