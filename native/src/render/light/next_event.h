// Next-event estimation: rays to the scene's lights, its emissive triangles, and what is bright in its environment.
// In: vertices of paths, the number of the sample. Out: shadow rays with the light that they may bring.
// Of few lights each is asked; of many, two a sample are chosen by how much they may give (importance sampling).
// Where the surface's own rays may find the same light, each way counts as much as it is likely to choose the direction
// (balance heuristic, Veach and Guibas 1995), so that the sum is right and neither way is far off: small lights are
// found by the first, what is large or near by the second.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/appearance/appearance.h"
#include "render/light/emissive_triangles.h"
#include "render/light/environment.h"
#include "render/light/path.h"
#include "render/light/secondary_rays.h"

namespace perfect_bvh {

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
