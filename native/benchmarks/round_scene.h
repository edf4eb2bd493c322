// Curves or points as every competitor gets them, and what they are as triangles.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "ray_sets.h"
#include "tlas/assemble.h"

namespace perfect_bvh::bench {

struct RoundScene {
  std::vector<Vec3f> centres;
  std::vector<float> radii;
  std::vector<std::int64_t> offsets;       // of each curve its first ball, then how many there are; none: points
  std::vector<std::vector<Vec3f>> frames;  // the centres in the wind
  Mesh mesh;                               // ours

  [[nodiscard]] bool has_curves() const noexcept { return !offsets.empty(); }
};

// Little-endian uint32 numbers of balls, of curves (0: points) and of frames; float32 x, y, z and radius of each ball;
// uint32 first balls of curves; float32 centres of each frame. Throws std::runtime_error.
[[nodiscard]] RoundScene read_round_scene(const std::string& path);

// Tubes of six sides, open at their ends; of points octahedra.
[[nodiscard]] Mesh tessellated(const RoundScene& scene);

// "primary", "diffuse", "shuffled" and "occlusion" (ray_sets.h), the latter from what primary rays hit of a scene of
// one instance.
[[nodiscard]] std::vector<RaySet> make_round_ray_sets(const Snapshot& snapshot, View view, std::uint32_t width,
                                                      std::uint32_t height);

}  // namespace perfect_bvh::bench
