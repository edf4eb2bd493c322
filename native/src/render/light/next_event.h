// A light path, followed backwards from the camera: its state between two surfaces.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/aligned.h"
#include "core/cancel.h"
#include "query/round_surface.h"
#include "query/trace.h"
#include "render/appearance/appearance.h"
#include "render/light/emitters.h"
#include "render/surface/bsdf.h"
#include "render/surface/surface.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Limits of paths: a scene's "Light Paths", with Blender's names and meanings.
struct LightPaths {
  int max_bounces = 4, diffuse_bounces = 4, glossy_bounces = 4, transmission_bounces = 4;
  int transparent_bounces = 8;
  float clamp_direct = 0.0f, clamp_indirect = 10.0f;  // 0: none
  float filter_glossy = 1.0f;                         // 0: none
  bool reflective_caustics = true, refractive_caustics = true;
};

struct Path {
  std::uint32_t owner = 0;          // the row of the camera ray
  std::uint32_t place = 0;          // selects its random numbers (ShadeTask::places)
  Vec3f throughput{1, 1, 1};        // the remaining share of light along its ray
  Vec3f guide_throughput{1, 1, 1};  // the same for a denoiser's guides
  Vec3f absorption{0, 0, 0};        // of the medium that its ray crosses, per length
  // The width of a pixel at the last surface, and its growth per length of the ray.
  double pixel = 0.0, spread = 0.0;
  // Of its direction, over solid angle; infinite if there was no choice.
  float density = std::numeric_limits<float>::infinity();
  float least_density = std::numeric_limits<float>::max();  // the minimum over all its directions
  // The last surface, as next-event estimation used it: its normal, whether it transmits light, the number of lights
  // sampled (0: all), and the sum of all lights' estimates. The normal of a strand is zero.
  Vec3f normal{0, 0, 1};
  bool transmits = false;
  std::uint8_t picks = 0;
  float guess_sum = 0.0f;
  Scatter last = Scatter::kNone;  // none: seen directly by the camera
  bool guides = false;            // whether it still needs a denoiser's guides
  bool meets_lights = false;      // whether lights that it hits count
  bool ends = false;              // at the next surface, of which only the emission counts
  std::uint8_t bounces = 0, diffuse = 0, glossy = 0, transmission = 0, transparent = 0;

  [[nodiscard]] bool is_seen() const noexcept { return bounces == 0; }
};

// Paths that are followed together; one row each. `points` are those of the rays that hit something.
struct Wave {
  AlignedVector<Path> paths;
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<SurfacePoint> points;

  void clear() noexcept { paths.clear(), rays.clear(), hits.clear(), points.clear(); }
  void add(const Path& path, const Ray& ray) { paths.push_back(path), rays.push_back(ray); }
};

// A surface hit by a path, ready to be lit and to scatter.
struct Vertex {
  Vertex(const SurfacePoint& surface, const Material& material, Vec3f view, const Bsdf::Limits& limits,
         const Path& arrived) noexcept
      : point(surface),
        bsdf(material, surface.light_normal, surface.geometric_normal, view, surface.inside, limits),
        path(arrived) {}

  SurfacePoint point;
  Bsdf bsdf;
  Path path;
};

// Secondary rays ------------------------------------------------------------------------------------------------------
// Rays that leave a surface, towards lights, the environment and other surfaces; and the share of light that passes
// along rays to lights: all, nothing, or the share that transparent surfaces let through.

// Makes a ray that leaves its triangle on the side of its direction, so it never hits that triangle.
[[nodiscard]] inline Ray ray_from(const SurfacePoint& point, Vec3f direction, float reach,
                                  std::uint32_t mask) noexcept {
  Ray ray;
  ray.direction = to_double(direction);
  const bool leads_beyond = dot(direction, point.geometric_normal) < 0.0f;
  ray.origin = leads_beyond ? point.beyond : point.origin;
  if (point.ribbon_width > 0.0f) {
    ray.t_min = point.ribbon_width;
  } else if (point.strand != nullptr && leads_beyond) {
    ray.origin = leave_curve(*point.strand, point.segment, ray.origin, ray.direction, point.time);
  }
  ray.t_max = reach;
  ray.mask = mask;
  ray.time = point.time;
  return ray;
}

// The same for a ray towards a light. If the light is low over a coarse mesh's triangle, neighbours would block it that
// the true curved surface does not have. So, as in Cycles, the ray starts on that surface. A light behind the triangle
// is then only seen past its edge.
[[nodiscard]] inline Ray shadow_ray(const SurfacePoint& point, Vec3f direction, float reach,
                                    std::uint32_t mask) noexcept {
  Ray ray = ray_from(point, direction, reach, mask);
  if (point.lift == Vec3f{0, 0, 0}) return ray;
  constexpr float kLow = 0.1f;  // a cosine; fades out up to twice that
  const float along_normal = dot(direction, point.mesh_normal);
  const bool passes = along_normal < 0.0f;
  const float over_curve = std::abs(along_normal) / kLow;
  const float over_triangle = dot(direction, point.geometric_normal) / (passes ? -kLow : kLow);
  const float share = std::clamp(1.0f - over_triangle + std::max(1.0f - over_curve, 0.0f), 0.0f, 1.0f);
  if (share > 0.0f) {
    ray.origin = (passes ? point.beyond : point.origin) + to_double((passes ? point.lift_beyond : point.lift) * share);
  }
  return ray;
}

// Rays that leave a ribbon have its width as t_min. Lets each begin at the first mesh before that, so that only ribbons
// are skipped. Returns whether there are such rays.
bool begin_at_meshes(const Snapshot& snapshot, CancelToken& cancel, std::span<Ray> rays);

// Buffers of one thread; one row per ray.
struct ShadowRays {
  AlignedVector<Ray> rays;
  AlignedVector<std::uint32_t> vertices;  // the row of the ray's vertex
  AlignedVector<Vec3f> carried;           // its contribution to the image if nothing is in the way
  AlignedVector<float> passed;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint8_t> blocked;

  void clear() noexcept { rays.clear(), vertices.clear(), carried.clear(); }
  void add(const Ray& ray, std::uint32_t vertex, Vec3f light) {
    rays.push_back(ray), vertices.push_back(vertex), carried.push_back(light);
  }
};

// Fills `passed`, and changes the rays.
// vertices: the origins of the rays. most_layers: the transparent surfaces that a path and its shadow ray may pass in
// all; anything behind them is dark.
void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, std::span<const Vertex> vertices,
                      int most_layers, CancelToken& cancel, ShadowRays& shadows);

// Next event ----------------------------------------------------------------------------------------------------------
// Next-event estimation: rays to the scene's lights, its emissive triangles, and the bright parts of its environment.
// In: vertices of paths, the number of the sample. Out: shadow rays with the light that they may carry.
// If there are few lights, each is sampled; if many, two per sample are chosen by their estimated contribution
// (importance sampling).
// If the surface's own rays may find the same light, the two techniques are weighted by their densities for the
// direction (balance heuristic, Veach and Guibas 1995). So the sum is right and has low variance: small lights are
// found by the first, large or near ones by the second.

// Returns the weight of a technique that chooses a direction with this density, combined with one of the other density.
// Densities are over solid angle. This one may be infinite, as for a point light: then it is the only technique.
[[nodiscard]] constexpr float balance(float density, float other) noexcept {
  return density > 0.0f ? 1.0f / (1.0f + other / density) : 0.0f;
}

class NextEvent {
 public:
  // All arguments must outlive this.
  NextEvent(const Snapshot& snapshot, const Appearance& appearance, const Environment& environment, std::uint32_t seed);

  [[nodiscard]] const EmissiveTriangles& emissive() const noexcept { return emissive_; }
  [[nodiscard]] bool empty() const noexcept {
    return appearance_.lights.empty() && emissive_.empty() && !environment_.can_be_aimed_at();
  }

  // Samples lights at each vertex. Stores in the paths the data they need to hit lights themselves. `guesses` is the
  // caller's buffer.
  void aim(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension, std::vector<float>& guesses,
           ShadowRays& shadows) const;

  // Returns the light of the lights that a path's ray hits before its hit.
  [[nodiscard]] Vec3f meet_lights(const Path& path, const Ray& ray, float hit_t) const;

  // The number of dimensions that `aim` takes.
  static constexpr std::uint32_t kDimensions = 11;

 private:
  void aim_at_each(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                   ShadowRays& shadows) const;
  void aim_at_some(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                   std::vector<float>& guesses, ShadowRays& shadows) const;
  void aim_at_emissive(std::span<const Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension,
                       ShadowRays& shadows) const;
  void aim_at_sky(std::span<const Vertex> vertices, std::uint32_t index, std::uint32_t dimension,
                  ShadowRays& shadows) const;
  // tries: the mean number of rays that the vertex aims at this light.
  void aim_at(const Vertex& vertex, std::uint32_t row, const Light& light, Point2 random, float tries,
              ShadowRays& shadows) const;
  static constexpr std::uint8_t kAll = 0;
  // Returns the number of lights that a vertex of the path samples, or kAll.
  [[nodiscard]] std::uint8_t picks_of(const Path& path) const noexcept;
  [[nodiscard]] bool can_be_met(const Light& light) const noexcept { return light.size_x > 0.0f && light.casts_shadow; }

  const Appearance& appearance_;
  const Environment& environment_;
  std::uint32_t seed_;
  EmissiveTriangles emissive_;
  bool any_met_;  // whether rays can hit any light
};

}  // namespace perfect_bvh
