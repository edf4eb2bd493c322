// Meshes of curves and of points to test builders on, ordinary and hard; all from fixed seeds.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "mesh/round_mesh.h"

namespace perfect_bvh::test {

struct RoundInput {
  std::vector<Vec3f> centres;
  std::vector<float> radii;
  std::vector<std::int64_t> offsets{0};  // one more than the number of curves; not used for points

  void end_curve() { offsets.push_back(static_cast<std::int64_t>(centres.size())); }
  [[nodiscard]] BallsGiven<float> balls() const { return {centres, radii}; }
  [[nodiscard]] Mesh curves() const { return make_curves(balls(), offsets, CurveShape::kRound, "test"); }
  [[nodiscard]] Mesh points() const { return make_points(balls(), "test"); }
};

// Strands that grow from a plate and bend, thinner towards their tips, whose radius is 0.
inline RoundInput fur(std::size_t strands, std::size_t segments, float radius, float bend, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f);
  RoundInput input;
  for (std::size_t strand = 0; strand < strands; ++strand) {
    Vec3f at{place(random), place(random), 0.0f}, step{bend * place(random), bend * place(random), 1.0f};
    for (std::size_t i = 0; i <= segments; ++i) {
      const float share = static_cast<float>(i) / static_cast<float>(segments);
      input.centres.push_back(at);
      input.radii.push_back(radius * (1.0f - share));
      at = at + step * (0.5f / static_cast<float>(segments));
      step = step + Vec3f{place(random), place(random), place(random)} * (0.3f * bend);
    }
    input.end_curve();
  }
  return input;
}

inline RoundInput cloud(std::size_t count, float least, float most, std::uint32_t seed = 2) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f), size(least, most);
  RoundInput input;
  for (std::size_t i = 0; i < count; ++i) {
    input.centres.push_back({place(random), place(random), place(random)});
    input.radii.push_back(size(random));
  }
  return input;
}

// Cones of any width, spheres inside spheres, segments of zero length: curves of two points each.
inline RoundInput odd_segments(std::size_t count, std::uint32_t seed = 3) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-1.0f, 1.0f);
  RoundInput input = cloud(2 * count, 0.0f, 0.3f, seed);
  for (std::size_t i = 0; i < count; ++i) {
    Vec3f &first = input.centres[2 * i], &last = input.centres[2 * i + 1];
    if (i % 4 == 1) last = first;
    if (i % 4 == 2) last = first + Vec3f{place(random), place(random), place(random)} * 0.05f;
    if (i % 4 == 3) last.x = first.x;
    if (i % 5 == 0) input.radii[2 * i] = 0.0f;
    if (i % 7 == 0) input.radii[2 * i + 1] = 0.0f;
    input.offsets.push_back(static_cast<std::int64_t>(2 * i + 2));
  }
  return input;
}

inline RoundInput far_away(RoundInput input, float distance, float factor) {
  for (Vec3f& centre : input.centres) centre = centre * factor + Vec3f{distance, -distance, distance};
  for (float& radius : input.radii) radius *= factor;
  return input;
}

struct NamedRound {
  std::string name;
  Mesh mesh;
};

inline std::vector<NamedRound> round_meshes() {
  RoundInput same = cloud(300, 0.1f, 0.1f);
  for (Vec3f& centre : same.centres) centre = {1.0f, -2.0f, 3.0f};
  RoundInput nested = cloud(200, 0.1f, 1.0f);
  for (Vec3f& centre : nested.centres) centre = centre * 0.001f;
  RoundInput gaps = cloud(500, -0.3f, 0.3f);
  for (float& radius : gaps.radii) radius = std::max(radius, 0.0f);
  const RoundInput one = cloud(1, 0.5f, 0.5f), none;
  return {{"fur", fur(120, 8, 0.01f, 0.3f).curves()},
          {"sticks", fur(400, 1, 0.002f, 2.0f).curves()},
          {"thick", fur(30, 20, 0.2f, 0.5f).curves()},
          {"odd segments", odd_segments(200).curves()},
          {"points", cloud(1000, 0.01f, 0.05f).points()},
          {"points with gaps", gaps.points()},
          {"one place", same.points()},
          {"nested", nested.points()},
          {"one", one.points()},
          {"none", none.points()},
          {"no curves", none.curves()},
          {"far away", far_away(fur(50, 8, 0.01f, 0.3f), 1e6f, 10.0f).curves()},
          {"tiny", far_away(cloud(300, 0.01f, 0.05f), 0.0f, 1e-15f).points()},
          {"huge", far_away(fur(50, 4, 0.01f, 0.3f), 0.0f, 1e16f).curves()}};
}

// A point in a primitive, more often at its ends and surface than inside; in double precision.
inline Vec3d point_inside(const Mesh& mesh, std::size_t primitive, std::mt19937& random) {
  const bool is_point = mesh.kind == PrimitiveKind::kPoints;
  const std::size_t first = is_point ? primitive : mesh.segments[primitive] & kSegmentBall;
  const Ball &a = mesh.balls[first], &b = mesh.balls[is_point ? first : first + 1];
  std::uniform_real_distribution<double> any(-0.2, 1.2), part(-1.0, 1.0);
  const double share = std::clamp(any(random), 0.0, 1.0);
  const double radius = (1 - share) * static_cast<double>(a.radius) + share * static_cast<double>(b.radius);
  Vec3d way{part(random), part(random), part(random)};
  for (int axis = 0; axis < 3; ++axis) {
    if (random() % 4 == 0) way[axis] = 0;
  }
  const double size = length(way);
  const double reach = size > 0 ? radius * std::min(std::clamp(any(random), 0.0, 1.0) + 0.5, 1.0 - 1e-12) / size : 0;
  return to_double(a.centre) * (1 - share) + to_double(b.centre) * share + way * reach;
}

[[nodiscard]] inline bool holds(const Aabb& box, Vec3d point) noexcept {
  bool inside = true;
  for (int axis = 0; axis < 3; ++axis) {
    inside &=
        static_cast<double>(box.lower[axis]) <= point[axis] && point[axis] <= static_cast<double>(box.upper[axis]);
  }
  return inside;
}

}  // namespace perfect_bvh::test
