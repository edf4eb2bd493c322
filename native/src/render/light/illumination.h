// The light that arrives at surfaces: from a scene's lights, from the environment, and from other surfaces, which are
// lit in their turn by lights, and by a fixed share of the environment. No more bounces: a preview should be
// recognised, not measured. Rays that look for that share take three times as long to an image of the same noise. In:
// points of surfaces, the number of the sample. Out: irradiance over pi: what a white diffuse surface gives back; and
// what a glossy one adds to that: highlights and what it mirrors, itself shown diffuse. Bright light is sampled by
// next-event estimation (next_event.h) and also found by rays that the surface spreads or mirrors, each weighted by
// multiple_importance.h.
#pragma once

#include <cstdint>
#include <span>

#include "core/aligned.h"
#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/light/environment.h"
#include "render/light/light_receivers.h"
#include "render/light/next_event.h"
#include "render/light/shadow_rays.h"
#include "render/surface/material.h"

namespace perfect_bvh {

class Illumination {
 public:
  // Buffers of one thread.
  struct Scratch {
    NextEvent::Scratch choices;
    ShadowRays shadows;
    AlignedVector<Mirrored> lobes;  // a row a point; black where nothing is mirrored
    // Of rays that the surface spreads or mirrors, a row a ray.
    AlignedVector<Ray> rays;
    AlignedVector<Hit> hits;
    AlignedVector<std::uint32_t> rows, places;  // of their points
    AlignedVector<float> densities;             // of their directions
    AlignedVector<Vec3f> arriving;
    AlignedVector<Vec3f> aimed_at;  // the part of that which next-event estimation samples, too
    // What those rays meet, a row a point.
    AlignedVector<SurfacePoint> bounce_points;
    AlignedVector<std::uint32_t> bounce_places;
    AlignedVector<Vec3f> bounce_light;
    AlignedVector<Material> bounce_materials;
  };

  // All of it outlives this. light_rays: towards each source of light, for each point and sample. threads: at most so
  // many, now.
  Illumination(const Snapshot& snapshot, const Appearance& appearance, std::uint32_t seed, int light_rays, int threads,
               CancelToken& cancel);

  // Replaces `light` and `shine`. What is not diffuse gets none of the cosine-weighted light.
  void gather(PointsToLight at, std::uint32_t sample, Scratch& scratch) const;

  [[nodiscard]] const Environment& environment() const noexcept { return environment_; }

 private:
  void choose_lobes(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const;
  void add_aimed(const PointsToLight& at, std::span<const Mirrored> lobes, std::uint32_t index,
                 std::uint32_t first_dimension, Scratch& scratch) const;
  void add_environment(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const;
  void add_mirrored(const PointsToLight& at, std::uint32_t index, Scratch& scratch) const;
  // Fills `arriving` with what comes along the rays of `scratch`. openness: what part of the light from all around
  // reaches the surfaces that they meet.
  void look_along_rays(std::uint32_t index, float openness, Scratch& scratch) const;
  void see_surface(const SurfacePoint& point, Scratch& scratch) const;
  // What comes along a ray from behind all surfaces, so much of it as passes those.
  void see_environment(std::size_t ray, float passing, Scratch& scratch) const;
  void light_bounces(std::uint32_t index, float openness, Scratch& scratch) const;

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Appearance& appearance_;
  std::uint32_t seed_;
  int light_rays_;
  Environment environment_;
  NextEvent next_event_;
};

}  // namespace perfect_bvh
