// The rays that benchmarks cast at a mesh: primary; diffuse bounces in the order of the pixels they come from; the same
// shuffled; and ambient occlusion within a tenth of the scene's diagonal.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "ray_caster.h"
#include "traverse/ray.h"

namespace perfect_bvh::bench {

struct RaySet {
  std::string name;
  RayUse use;
  std::vector<Ray> rays;
};

// From outside, the camera either frames the box, so that many rays miss, or looks only at its middle, so that the mesh
// fills the view. For meshes that are seen from inside, the camera is inside them.
enum class View { kOutside, kFilling, kInside };

[[nodiscard]] std::vector<Ray> primary_rays(const Aabb& box, View view, std::uint32_t width, std::uint32_t height);

// Makes diffuse rays from the hits of the primary rays (t and triangle of each), cosine-weighted about the side they
// came from.
struct Bounces {
  std::vector<Ray> diffuse, occlusion;
};
[[nodiscard]] Bounces bounce_rays(const Mesh& mesh, const std::vector<Ray>& primary, const std::vector<Hit>& hits,
                                  float diagonal);

// Makes one such diffuse ray; the normal has unit length.
[[nodiscard]] Ray diffuse_ray(Vec3d origin, Vec3d normal, std::mt19937& random);

[[nodiscard]] std::vector<RaySet> make_ray_sets(const Mesh& mesh, const Aabb& box, View view,
                                                const std::vector<Ray>& primary, const std::vector<Hit>& hits);

// Makes rays of an image with `width` pixels a row: "tiled" are the primary rays in Z-order within tiles of 8 x 8;
// "shadow" are rays from their hits, in that order, towards one point above the box.
[[nodiscard]] std::vector<RaySet> make_coherent_sets(const Aabb& box, const std::vector<Ray>& primary,
                                                     const std::vector<Hit>& hits, std::uint32_t width);

// Makes rays from inside a star-shaped mesh about the origin (from points up to halfway to its vertices). They aim at
// random vertices or points of edges, as exactly as float allows.
[[nodiscard]] std::vector<Ray> aimed_rays(const Mesh& mesh, std::size_t count, bool at_edges, std::size_t seed);

// Reads little-endian uint32 vertex count, triangle count; float32 positions; uint32 triangles.
[[nodiscard]] Mesh read_mesh(const std::string& path);

}  // namespace perfect_bvh::bench
