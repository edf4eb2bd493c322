// A path of light, followed backwards from the camera: what is known of it between two surfaces.
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
  Vec3f absorption{0, 0, 0};        // of what its ray crosses, by length
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
// Rays that leave a surface, towards lights, the environment and other surfaces; and of those towards lights how much
// gets through what is in their way: all of it, nothing, or what transparent surfaces let through.

// A ray leaves its triangle on the side that it leads to, and so never meets it.
[[nodiscard]] inline Ray ray_from(const SurfacePoint& point, Vec3f direction, float reach,
                                  std::uint32_t mask) noexcept {
  Ray ray;
  ray.direction = to_double(direction);
  const bool leads_beyond = dot(direction, point.geometric_normal) < 0.0f;
  ray.origin = leads_beyond ? point.beyond : point.origin;
  if (point.strand != nullptr && leads_beyond) {
    ray.origin = leave_curve(*point.strand, point.segment, ray.origin, ray.direction, point.time);
  }
  ray.t_max = reach;
  ray.mask = mask;
  ray.time = point.time;
  return ray;
}

// The same towards a light. Where that is low over a coarse mesh's triangle, the neighbours are in the way that the
// curved surface would not have: there, as in Cycles, the ray starts on that surface. From there a light on the
// triangle's other side is seen past its edge only.
[[nodiscard]] inline Ray shadow_ray(const SurfacePoint& point, Vec3f direction, float reach,
                                    std::uint32_t mask) noexcept {
  Ray ray = ray_from(point, direction, reach, mask);
  if (point.lift == Vec3f{0, 0, 0}) return ray;
  constexpr float kLow = 0.1f;  // a cosine; up to twice that it fades
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

// Buffers of one thread; a row a ray.
struct ShadowRays {
  AlignedVector<Ray> rays;
  AlignedVector<std::uint32_t> vertices;  // the row of the vertex that a ray belongs to
  AlignedVector<Vec3f> carried;           // what it adds to the image if nothing is in its way
  AlignedVector<float> passed;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint8_t> blocked;

  void clear() noexcept { rays.clear(), vertices.clear(), carried.clear(); }
  void add(const Ray& ray, std::uint32_t vertex, Vec3f light) {
    rays.push_back(ray), vertices.push_back(vertex), carried.push_back(light);
  }
};

// Fills `passed`. Spoils the rays.
// vertices: where the rays start. most_layers: transparent surfaces that a path and its shadow ray pass together; what
// is behind them is dark.
void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, std::span<const Vertex> vertices,
                      int most_layers, CancelToken& cancel, ShadowRays& shadows);

// Next event ----------------------------------------------------------------------------------------------------------
// Next-event estimation: rays to the scene's lights, its emissive triangles, and what is bright in its environment.
// In: vertices of paths, the number of the sample. Out: shadow rays with the light that they may bring.
// Of few lights each is asked; of many, two a sample are chosen by how much they may give (importance sampling).
// Where the surface's own rays may find the same light, each way counts as much as it is likely to choose the direction
// (balance heuristic, Veach and Guibas 1995), so that the sum is right and neither way is far off: small lights are
// found by the first, what is large or near by the second.

// The share of a way that chooses a direction with this density, beside one of the other density. Densities are those
// of solid angle; this one may be infinite, as of a point of light: then it is the only way.
[[nodiscard]] constexpr float balance(float density, float other) noexcept {
  return density > 0.0f ? 1.0f / (1.0f + other / density) : 0.0f;
}

class NextEvent {
 public:
  // All of it outlives this.
  NextEvent(const Snapshot& snapshot, const Appearance& appearance, const Environment& environment, std::uint32_t seed);

  [[nodiscard]] const EmissiveTriangles& emissive() const noexcept { return emissive_; }
  [[nodiscard]] bool empty() const noexcept {
    return appearance_.lights.empty() && emissive_.empty() && !environment_.can_be_aimed_at();
  }

  // A sample at each vertex. Tells the paths what they must know of it to find lights themselves. `guesses` is the
  // caller's buffer.
  void aim(std::span<Vertex> vertices, std::uint32_t index, std::uint32_t first_dimension, std::vector<float>& guesses,
           ShadowRays& shadows) const;

  // What the lights bring that a path's ray meets before its hit.
  [[nodiscard]] Vec3f meet_lights(const Path& path, const Ray& ray, float hit_t) const;

  // How many dimensions `aim` takes.
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
  // tries: how many rays the vertex aims at this light in the mean.
  void aim_at(const Vertex& vertex, std::uint32_t row, const Light& light, Point2 random, float tries,
              ShadowRays& shadows) const;
  static constexpr std::uint8_t kAll = 0;
  // How many lights a vertex of the path asks, or kAll.
  [[nodiscard]] std::uint8_t picks_of(const Path& path) const noexcept;
  [[nodiscard]] bool can_be_met(const Light& light) const noexcept { return light.size_x > 0.0f && light.casts_shadow; }

  const Appearance& appearance_;
  const Environment& environment_;
  std::uint32_t seed_;
  EmissiveTriangles emissive_;
  bool any_met_;  // whether any light may be met by rays
};

}  // namespace perfect_bvh
