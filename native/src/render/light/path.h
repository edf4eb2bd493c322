// A path of light, followed backwards from the camera: what is known of it between two surfaces.
#pragma once

#include <cstdint>
#include <limits>

#include "core/aligned.h"
#include "render/surface/bsdf.h"
#include "render/surface/surface.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// How far paths are followed: a scene's "Light Paths", with Blender's names and meanings.
struct LightPaths {
  int max_bounces = 4, diffuse_bounces = 4, glossy_bounces = 4, transmission_bounces = 4;
  int transparent_bounces = 8;
  float clamp_direct = 0.0f, clamp_indirect = 10.0f;  // 0: none
  float filter_glossy = 1.0f;                         // 0: none
  bool reflective_caustics = true, refractive_caustics = true;
};

struct Path {
  std::uint32_t owner = 0;          // the row of the camera ray
  std::uint32_t place = 0;          // by which its random numbers differ from its neighbours' (ShadeTask::places)
  Vec3f throughput{1, 1, 1};        // what is left of light that comes along its ray
  Vec3f guide_throughput{1, 1, 1};  // the same for a denoiser's guides
  // Of its direction, over solid angle; infinite where it was without choice.
  float density = std::numeric_limits<float>::infinity();
  float least_density = std::numeric_limits<float>::max();  // of all its directions
  // The last surface, as next-event estimation saw it: its normal, whether it lets light through, how many lights it
  // asked (0: each), and the sum of what all lights were thought to bring. A strand has no normal: zero.
  Vec3f normal{0, 0, 1};
  bool transmits = false;
  std::uint8_t picks = 0;
  float guess_sum = 0.0f;
  Scatter last = Scatter::kNone;  // none: the camera sees it
  bool guides = false;            // whether it still looks for what guides a denoiser
  bool meets_lights = false;      // whether what it finds of lights counts
  bool ends = false;              // at the next surface, whose own light is all that counts
  std::uint8_t bounces = 0, diffuse = 0, glossy = 0, transmission = 0, transparent = 0;

  [[nodiscard]] bool is_seen() const noexcept { return bounces == 0; }
};

// Paths that are followed together; a row each. `points` are those of the rays that hit something.
struct Wave {
  AlignedVector<Path> paths;
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<SurfacePoint> points;

  void clear() noexcept { paths.clear(), rays.clear(), hits.clear(), points.clear(); }
  void add(const Path& path, const Ray& ray) { paths.push_back(path), rays.push_back(ray); }
};

// A surface that a path met, ready to be lit and to scatter.
struct Vertex {
  SurfacePoint point;
  Bsdf bsdf;
  Path path;
};

}  // namespace perfect_bvh
