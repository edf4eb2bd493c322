// The properties of each primitive kind: the number in a mesh, vertices, box, slices, names for callers. Trees, updates
// and queries are templates on these classes, and select the kind by `with_kind`, outside of their loops. Higher layers
// add to a kind by overloads for its class, for example for leaves (wide/leaf_block.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "math/aabb.h"
#include "math/round_segment.h"
#include "math/vec3.h"
#include "mesh/clip.h"
#include "mesh/mesh.h"
#include "stats/statistics.h"

namespace perfect_bvh {

struct PrimitiveNames {
  const char* kind;
  const char* vertices;  // the name for callers
  const char* editor;    // its calls are update_..., replace_... and set_..._motion
  const char* whose;     // for messages on the number of vertices
};

// Returns the number of spheres that the caller gave, including omitted ones.
[[nodiscard]] inline std::size_t given_ball_count(const Mesh& mesh) noexcept {
  return mesh.numbers.empty() ? mesh.balls.size() : mesh.numbers[mesh.numbers.size() - 1];
}

struct TriangleTraits {
  static constexpr PrimitiveNames kNames{"triangles", "positions", "mesh", "triangles"};
  static constexpr auto kCounted = &PrimitiveCounts::triangles;
  static constexpr std::uint32_t kBalls = 0;    // of which a primitive is the hull
  static constexpr std::size_t kCorners = 3;    // with separate normals, uvs and colours
  static constexpr float kMovingExtent = 1.0f;  // of boxes between two steps of a motion, relative to the extent

  static std::size_t count(const Mesh& mesh) noexcept { return mesh.triangles.size(); }
  static const AlignedVector<Vec3f>& vertices(const Mesh& mesh) noexcept { return mesh.positions; }

  static Aabb box(const Mesh& mesh, std::size_t index) noexcept {
    const TriangleIndices t = mesh.triangles[index];
    Aabb box;
    box.grow(mesh.positions[t.x]), box.grow(mesh.positions[t.y]), box.grow(mesh.positions[t.z]);
    return box;
  }
  static void slice(const Mesh& mesh, std::size_t index, int axis, std::span<const float> planes,
                    Box4* slices) noexcept {
    const TriangleIndices t = mesh.triangles[index];
    slice_triangle(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z], axis, planes, slices);
  }
  // Returns half the surface of the boxes that remain of a primitive's, for any cuts.
  static double solid_area(const Mesh& mesh, std::size_t index) noexcept {
    const TriangleIndices t = mesh.triangles[index];
    const Vec3d a = to_double(mesh.positions[t.x]), b = to_double(mesh.positions[t.y]),
                c = to_double(mesh.positions[t.z]);
    return kSolid * (0.5 * length(cross(b - a, c - a)));
  }

  // Data on the caller's input, of which a primitive is an item or a part: the number of items, the number of
  // primitives omitted from them, the caller's number for a primitive, and the u of a hit along the whole item, 0 to 1.
  static std::size_t part_count(const Mesh& mesh) noexcept { return count(mesh); }
  static std::size_t left_out_count(const Mesh& /*mesh*/) noexcept { return 0; }
  static std::uint32_t caller_number(const Mesh& /*mesh*/, std::uint32_t primitive) noexcept { return primitive; }
  static float u_of_part(const Mesh& /*mesh*/, std::uint32_t /*primitive*/, float u) noexcept { return u; }

  static constexpr double kSolid = 3;  // half the surface of a box without empty space, per area of its content
};

// Hulls of consecutive spheres.
template <class Kind>
struct OverBalls {
  // A sphere's box is its centre minus and plus its radius, each interpolated and rounded. This exceeds the margin of
  // the slab test (math/slab.h) by 3 u R, so the extent is larger.
  static constexpr float kMovingExtent = 1.5f;
  static constexpr std::size_t kCorners = 1;

  static const AlignedVector<Ball>& vertices(const Mesh& mesh) noexcept { return mesh.balls; }
  static const Ball& first(const Mesh& mesh, std::size_t index) noexcept {
    return mesh.balls[Kind::first_ball(mesh, index)];
  }
  static const Ball& last(const Mesh& mesh, std::size_t index) noexcept {
    return mesh.balls[Kind::first_ball(mesh, index) + (Kind::kBalls - 1)];
  }
  // The box of a convex hull is the box of its spheres.
  static Aabb box(const Mesh& mesh, std::size_t index) noexcept {
    Aabb box = box_of(first(mesh, index));
    if constexpr (Kind::kBalls > 1) box.grow(box_of(last(mesh, index)));
    return box;
  }
  static void slice(const Mesh& mesh, std::size_t index, int axis, std::span<const float> planes,
                    Box4* slices) noexcept {
    slice_segment(first(mesh, index), last(mesh, index), axis, planes, slices);
  }
  // Returns that of a box along a segment, around its larger sphere: the space around a sphere cannot be cut away.
  static double solid_area(const Mesh& mesh, std::size_t index) noexcept {
    const Ball &a = first(mesh, index), &b = last(mesh, index);
    const double width = 2 * static_cast<double>(std::max(a.radius, b.radius));
    return TriangleTraits::kSolid * width * width + 2 * width * length(to_double(b.centre) - to_double(a.centre));
  }
};

struct CurveTraits : OverBalls<CurveTraits> {
  static constexpr PrimitiveNames kNames{"curves", "points", "curves", "in all curves"};
  static constexpr auto kCounted = &PrimitiveCounts::segments;
  static constexpr std::uint32_t kBalls = 2;

  static std::size_t count(const Mesh& mesh) noexcept { return mesh.segments.size(); }
  static std::uint32_t first_ball(const Mesh& mesh, std::size_t index) noexcept {
    return mesh.segments[index] & kSegmentBall;
  }
  static std::size_t part_count(const Mesh& mesh) noexcept;
  static std::size_t left_out_count(const Mesh& mesh) noexcept;
  static std::uint32_t caller_number(const Mesh& mesh, std::uint32_t primitive) noexcept;
  static float u_of_part(const Mesh& mesh, std::uint32_t primitive, float u) noexcept;
};

struct PointTraits : OverBalls<PointTraits> {
  static constexpr PrimitiveNames kNames{"points", "centers", "points", "points"};
  static constexpr auto kCounted = &PrimitiveCounts::points;
  static constexpr std::uint32_t kBalls = 1;

  static std::size_t count(const Mesh& mesh) noexcept { return mesh.balls.size(); }
  static std::uint32_t first_ball(const Mesh& /*mesh*/, std::size_t index) noexcept {
    return static_cast<std::uint32_t>(index);
  }
  static std::size_t part_count(const Mesh& mesh) noexcept { return given_ball_count(mesh); }
  static std::size_t left_out_count(const Mesh& mesh) noexcept { return given_ball_count(mesh) - mesh.balls.size(); }
  static std::uint32_t caller_number(const Mesh& mesh, std::uint32_t primitive) noexcept {
    return mesh.numbers.empty() ? primitive : mesh.numbers[primitive];
  }
  static float u_of_part(const Mesh& /*mesh*/, std::uint32_t /*primitive*/, float /*u*/) noexcept { return 0.0f; }
};

// The only list of the kinds: calls body(TriangleTraits{}), or that of the mesh's kind.
template <class Body>
decltype(auto) with_kind(PrimitiveKind kind, const Body& body) {
  if (kind == PrimitiveKind::kCurves) return body(CurveTraits{});
  if (kind == PrimitiveKind::kPoints) return body(PointTraits{});
  return body(TriangleTraits{});
}
template <class Body>
void for_each_kind(const Body& body) {
  body(TriangleTraits{}), body(CurveTraits{}), body(PointTraits{});
}

inline const PrimitiveNames& names_of(PrimitiveKind kind) noexcept {
  return with_kind(kind, []<class Kind>(Kind) -> const PrimitiveNames& { return Kind::kNames; });
}
inline std::size_t part_count_of(const Mesh& mesh) noexcept {
  return with_kind(mesh.kind, [&](auto kind) { return kind.part_count(mesh); });
}
inline std::size_t left_out_count(const Mesh& mesh) noexcept {
  return with_kind(mesh.kind, [&](auto kind) { return kind.left_out_count(mesh); });
}
inline std::uint32_t caller_number(const Mesh& mesh, std::uint32_t primitive) noexcept {
  return with_kind(mesh.kind, [&](auto kind) { return kind.caller_number(mesh, primitive); });
}
inline float u_of_part(const Mesh& mesh, std::uint32_t primitive, float u) noexcept {
  return with_kind(mesh.kind, [&](auto kind) { return kind.u_of_part(mesh, primitive, u); });
}
inline std::size_t Mesh::primitive_count() const noexcept {
  return with_kind(kind, [&](auto of_kind) { return of_kind.count(*this); });
}
inline Aabb Mesh::primitive_box(std::size_t index) const noexcept {
  return with_kind(kind, [&](auto of_kind) { return of_kind.box(*this, index); });
}

}  // namespace perfect_bvh
