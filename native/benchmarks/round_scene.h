// Curves or points as every competitor gets them, and their approximation by triangles.
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
  std::vector<std::int64_t> offsets;       // the first sphere of each curve, then the total count; empty: points
  std::vector<std::vector<Vec3f>> frames;  // the centres in each frame of the wind
  Mesh mesh;                               // as our engine takes it

  [[nodiscard]] bool has_curves() const noexcept { return !offsets.empty(); }
};

// Reads little-endian uint32 numbers of spheres, of curves (0: points) and of frames; float32 x, y, z and radius of
// each sphere; uint32 first spheres of curves; float32 centres of each frame. Throws std::runtime_error.
[[nodiscard]] RoundScene read_round_scene(const std::string& path);

// Makes tubes of six sides, open at their ends; for points octahedra.
[[nodiscard]] Mesh tessellated(const RoundScene& scene);

// Makes "primary", "diffuse", "shuffled" and "occlusion" rays (ray_sets.h); the last three start at the hits of primary
// rays in a scene of one instance.
[[nodiscard]] std::vector<RaySet> make_round_ray_sets(const Snapshot& snapshot, View view, std::uint32_t width,
                                                      std::uint32_t height);

}  // namespace perfect_bvh::bench
