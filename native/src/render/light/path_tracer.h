// Path tracing (Kajiya 1986) with next-event estimation: light that reaches the camera after any number of bounces.
// In: what camera rays hit, the number of the sample. Out: colours of the camera rays, and the albedo and normal by
// which a denoiser tells surfaces apart. The paths of a tile are followed together, bounce by bounce, so that their
// rays go through the batch kernels; nothing depends on which other paths those are.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/light/emitters.h"
#include "render/light/next_event.h"

namespace perfect_bvh {

// Where paths leave what they find, by their owners. The guides may be empty.
struct PathTargets {
  std::span<Rgba> colors;  // premultiplied by alpha
  std::span<Vec3f> albedos, normals;
};

// A point on a shadow catcher that the camera sees: what it shows is the caller's to find.
struct CaughtPoint {
  SurfacePoint point;
  Vec3f view;  // towards the viewer, unit length
  std::uint32_t owner, place;
  float weight;  // of it in the image
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
  // All of it outlives this. threads: at most so many, now.
  PathTracer(const Snapshot& snapshot, const Appearance& appearance, const LightPaths& limits, std::uint32_t seed,
             int threads, CancelToken& cancel);

  [[nodiscard]] const Environment& environment() const noexcept { return environment_; }

  // Follows the paths of `scratch.wave`, whose hits and points are known, to their ends, and adds what they find. Where
  // a camera ray hits nothing is the caller's to show, and what shadow catchers show, of which it gives the points.
  void follow(std::uint32_t sample, const PathTargets& targets, Scratch& scratch) const;
  // Replaces `light` by what white diffuse surfaces at these points give back. A row a point.
  void light_white(std::span<const CaughtPoint> points, std::uint32_t sample, AlignedVector<Rgba>& light,
                   Scratch& scratch) const;

 private:
  struct Step {
    std::uint32_t sample, first_dimension;
    const PathTargets& targets;
  };

  void follow(std::uint32_t sample, int depth, const PathTargets& targets, Scratch& scratch) const;
  void absorb(Wave& wave) const;
  // Takes the path to the other side of a surface that may enclose what absorbs light.
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
  // What a path that scattered so often brings, no brighter than is allowed.
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
