// Next-event estimation: rays to the scene's lights, its emissive triangles, and what is bright in its environment.
// In: points, the number of the sample. Out: shadow rays with the light and the highlights that they may bring.
// Of few lights each is asked; of many, two a sample are chosen by how much they may give (importance sampling).
// Where the surface's own rays may find the same light, both count by multiple_importance.h.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/appearance/appearance.h"
#include "render/light/emissive_triangles.h"
#include "render/light/environment.h"
#include "render/light/light_receivers.h"
#include "render/light/shadow_rays.h"

namespace perfect_bvh {

class NextEvent {
 public:
  // Buffers of one thread.
  struct Scratch {
    std::vector<float> guesses;  // of each light at a point, added up
    std::vector<float> sums;     // of them, a row a point
  };

  // All of it outlives this.
  NextEvent(const Snapshot& snapshot, const Appearance& appearance, const Environment& environment, std::uint32_t seed);

  [[nodiscard]] const EmissiveTriangles& glow() const noexcept { return emissive_; }
  [[nodiscard]] bool empty() const noexcept {
    return appearance_.lights.empty() && emissive_.empty() && !environment_.can_be_aimed_at();
  }

  // A sample at each point. lobes: a row a point, where rays look that a surface mirrors; black where none does. Light
  // that throws no shadow goes straight to the points.
  void aim(const PointsToLight& at, std::span<const Mirrored> lobes, std::uint32_t index, std::uint32_t first_dimension,
           Scratch& scratch, ShadowRays& shadows) const;

 private:
  void aim_at_each(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension,
                   ShadowRays& shadows) const;
  void aim_at_some(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension, Scratch& scratch,
                   ShadowRays& shadows) const;
  void aim_at_emissive(const PointsToLight& at, std::uint32_t index, std::uint32_t first_dimension,
                       ShadowRays& shadows) const;
  void aim_at_sky(const PointsToLight& at, std::uint32_t index, std::uint32_t dimension, ShadowRays& shadows) const;
  // tries: how many rays a point aims at this light in the mean.
  void aim_at(const PointsToLight& at, std::uint32_t row, const Light& light, Point2 random, float tries,
              ShadowRays& shadows) const;
  void meet_lights(const PointsToLight& at, std::span<const Mirrored> lobes, const Scratch& scratch,
                   ShadowRays& shadows) const;
  [[nodiscard]] bool asks_each() const noexcept;

  const Appearance& appearance_;
  const Environment& environment_;
  std::uint32_t seed_;
  EmissiveTriangles emissive_;
  bool any_large_ = false;  // whether the surface's rays may meet a light
};

}  // namespace perfect_bvh
