// A scene that moves within the shutter, as every competitor gets it, and the same scene frozen half-way.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "math/aabb.h"
#include "mesh/mesh.h"
#include "ray_sets.h"
#include "tlas/assemble.h"

namespace perfect_bvh::bench {

struct MotionScene {
  struct Shapes {
    std::vector<std::vector<Vec3f>> steps;  // one: the mesh keeps its shape
    std::vector<TriangleIndices> triangles;
  };
  struct Placed {
    std::uint32_t mesh;
    bool moves;
    std::vector<Affine> steps;  // all equal for an instance without motion
  };
  std::uint32_t step_count = 0;
  std::vector<Shapes> meshes;
  std::vector<Placed> instances;

  [[nodiscard]] StepTimes times() const noexcept { return {0.0f, static_cast<float>(step_count - 1), step_count - 1}; }
  // Returns the scene at one time, as a single step.
  [[nodiscard]] MotionScene frozen(float time) const;
};

// Reads a file of little-endian values: uint32 numbers of steps, meshes and instances; for each mesh uint32 steps (1 or
// all), vertices and triangles, float32 positions step by step, uint32 triangles; uint32 meshes of the instances;
// uint32 1 for those that move; float32 matrices of 3 rows and 4 columns, step by step. Throws std::runtime_error.
[[nodiscard]] MotionScene read_motion_scene(const std::string& path);

// Builds our scene on one thread, through the scene's interface as a user would.
[[nodiscard]] std::shared_ptr<const Snapshot> committed(const MotionScene& scene);

// Makes each kind of ray with random times, and as many of the same kind at time 0 for the frozen scene. Primary rays
// are the same in both; the other rays start where the same primary ray hits either scene.
struct MotionRays {
  RaySet moving, frozen;
};
[[nodiscard]] std::vector<MotionRays> make_motion_rays(const Snapshot& moving, const Snapshot& frozen, View view,
                                                       std::uint32_t width, std::uint32_t height);

}  // namespace perfect_bvh::bench
