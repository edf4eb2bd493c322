// Path tracing (Kajiya 1986) with next-event estimation: light that reaches the camera after any number of bounces.
// In: the hits of camera rays, the number of the sample. Out: the camera rays' colours, and the albedo and normal by
// which a denoiser distinguishes surfaces. The paths of a tile are followed together, bounce by bounce, so that their
// rays use the batch kernels. Results do not depend on which other paths are in the tile.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/light/emitters.h"
#include "render/light/next_event.h"

namespace perfect_bvh {

// The targets of paths' results, by owner. The guides may be empty.
struct PathTargets {
  std::span<Rgba> colors;  // premultiplied by alpha
  std::span<Vec3f> albedos, normals;
};

// A point on a shadow catcher that the camera sees; the caller computes its colour.
struct CaughtPoint {
  SurfacePoint point;
  Vec3f view;  // towards the viewer, unit length
  std::uint32_t owner, place;
  float weight;  // its share in the image
};

class PathTracer {
 public:
  // Buffers of one thread.
  struct Scratch {
    Wave wave, next;
    AlignedVector<Vertex> vertices;
    std::vector<float> guesses;
    ShadowRays shadows;
    AlignedVector<CaughtPoint> caught;
    MaterialReader materials;
  };
  // All arguments must outlive this. threads: the maximum for the constructor.
  PathTracer(const Snapshot& snapshot, const Appearance& appearance, const LightPaths& limits, std::uint32_t seed,
             int threads, CancelToken& cancel);

  [[nodiscard]] const Environment& environment() const noexcept { return environment_; }

  // Follows the paths of `scratch.wave`, whose hits and points are known, to their ends, and adds their light. The
  // caller shows the background where a camera ray hits nothing, and the shadow catchers, whose points this returns.
  void follow(std::uint32_t sample, const PathTargets& targets, Scratch& scratch) const;
  // Replaces `light` by the light that white diffuse surfaces at these points reflect, one row per point.
  void light_white(std::span<const CaughtPoint> points, std::uint32_t sample, AlignedVector<Rgba>& light,
                   Scratch& scratch) const;

 private:
  struct Step {
    std::uint32_t sample, first_dimension;
    const PathTargets& targets;
  };

  void follow(std::uint32_t sample, int depth, const PathTargets& targets, Scratch& scratch) const;
  void absorb(Wave& wave) const;
  // Moves the path to the other side of a surface that may enclose an absorbing medium.
  void widen(Path& path, const Ray& ray, const SurfacePoint& point, float t) const;
  void cross_border(Path& path, const SurfacePoint& point) const noexcept;
  void see_lights(const Step& step, Wave& wave) const;
  void see_environment(const Step& step, const Wave& wave) const;
  void see_surfaces(const Step& step, Scratch& scratch) const;
  void see_surface(const Step& step, const SurfacePoint& point, Material& material, Scratch& scratch) const;
  [[nodiscard]] Vec3f emitted(const Path& path, const Ray& ray, const Hit& hit, const SurfacePoint& point,
                              const Material& material) const;
  void pass(Path path, const Ray& ray, const Hit& hit, const SurfacePoint& point, float share, Wave& next) const;
  void pass_hair(const Path& path, const Ray& ray, const Hit& hit, Wave& next) const;
  void light_vertices(const Step& step, Scratch& scratch) const;
  void scatter(const Step& step, Scratch& scratch) const;
  void guide(const Step& step, const Path& path, Vec3f albedo, Vec3f normal) const;
  void guide_by(const Step& step, const Bsdf& bsdf, const SurfacePoint& point, Vec3f emission, Path& path) const;
  [[nodiscard]] bool goes_on(Path& path, const Bsdf::Sample& scattered, float roulette) const;
  [[nodiscard]] Bsdf::Limits limits_of(const Path& path) const noexcept;
  [[nodiscard]] std::uint32_t mask_of(Scatter kind) const noexcept;
  // Returns the light of a path after this many bounces, clamped to the limit.
  [[nodiscard]] Vec3f clamped(Vec3f color, int bounces) const noexcept;
  void add(const Step& step, const Path& path, Vec3f color, int bounces) const;

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Appearance& appearance_;
  LightPaths limits_;
  std::uint32_t seed_;
  Environment environment_;
  NextEvent next_event_;
};

}  // namespace perfect_bvh
