// Distances to random points, one in each cell of a grid, like Blender's Voronoi Texture. In: settings and a point.
// Out: the node's outputs.
//
// Worley 1996 ("A Cellular Texture Basis Function"); edges by the half planes between points; smooth minima by the
// polynomial of Quilez 2013 ("Smooth minimum"); octaves as in noise.h.
#pragma once

#include <cstdint>

#include "math/vec3.h"

namespace perfect_bvh {

enum class VoronoiFeature : std::uint8_t { kF1, kF2, kSmoothF1, kDistanceToEdge, kNSphereRadius };
enum class VoronoiMetric : std::uint8_t { kEuclidean, kManhattan, kChebychev, kMinkowski };

struct VoronoiSettings {
  int dimensions = 3;  // 1: w, 2: x and y, 3: x, y and z, 4: all
  VoronoiFeature feature = VoronoiFeature::kF1;
  VoronoiMetric metric = VoronoiMetric::kEuclidean;  // in one dimension all are equal
  bool normalize = false;                            // divides by the largest possible distance
  float scale = 5.0f, detail = 0.0f, roughness = 0.5f, lacunarity = 2.0f;
  float smoothness = 1.0f;  // kSmoothF1
  float exponent = 0.5f;    // kMinkowski
  float randomness = 1.0f;  // 0: the points are the corners of the grid
};

// Zero if the feature has no such output.
struct VoronoiTexture {
  float distance = 0.0f;    // kF1, kF2, kSmoothF1, kDistanceToEdge
  Vec3f color{0, 0, 0};     // of the point's cell; these three only for kF1, kF2, kSmoothF1
  Vec3f position{0, 0, 0};  // of the point, in the texture's coordinates
  float w = 0.0f;
  float radius = 0.0f;  // kNSphereRadius
};

[[nodiscard]] VoronoiTexture voronoi_texture(const VoronoiSettings& settings, Vec3f p, float w) noexcept;

}  // namespace perfect_bvh
