// The light that arrives at surfaces: from a scene's lights, from all around it, and from other surfaces, which are lit
// in their turn by lights, and by a fixed share of what is all around. No more bounces: a preview should be recognised,
// not measured. Rays that look for that share take three times as long to an image of the same noise.
// In: points of surfaces, the number of the sample. Out: irradiance over pi: what a white matt surface gives back; and
// what a glossy one adds to that: highlights and what it mirrors, itself shown matt.
// Of few lights each is asked; of many, two a sample are chosen by how much they may give (importance sampling). What
// glows is aimed at and also met by chance (multiple importance sampling, Veach and Guibas 1995).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/aligned.h"
#include "core/cancel.h"
#include "render/appearance.h"
#include "render/gloss.h"
#include "render/glow.h"
#include "render/material.h"
#include "render/surface.h"

namespace perfect_bvh {

class Illumination {
 public:
  // Buffers of one thread.
  struct Scratch {
    AlignedVector<Ray> rays;
    AlignedVector<Hit> hits;
    AlignedVector<std::uint8_t> blocked;
    AlignedVector<std::uint32_t> targets;  // the row of the point that a ray belongs to
    AlignedVector<Vec3f> carried, shine;   // what a ray brings if nothing is in its way: light, and a highlight
    AlignedVector<float> passed;           // how much gets through what is
    AlignedVector<float> densities;        // of directions all around, a row a ray; empty for other rays
    AlignedVector<SurfacePoint> bounce_points;
    AlignedVector<std::uint32_t> bounce_places;
    AlignedVector<Vec3f> bounce_light;
    AlignedVector<Material> bounce_materials;
    AlignedVector<Vec3f> arriving;         // a row a ray
    AlignedVector<std::uint32_t> mirrors;  // the rows of points that mirror something
    AlignedVector<std::uint32_t> mirror_places;
    AlignedVector<Vec3f> mirror_weights;
    std::vector<float> guesses;  // of each light, added up
  };

  // All of it outlives this. light_rays: towards each source of light, for each point and sample.
  Illumination(const Snapshot& snapshot, const Appearance& appearance, std::uint32_t seed, int light_rays,
               CancelToken& cancel);

  // A row a point. places: a number by which its samples differ from its neighbours' (sampling::z_order). glosses,
  // shine: empty where nothing is glossy.
  struct Points {
    std::span<const SurfacePoint> points;
    std::span<const std::uint32_t> places;
    std::span<const Gloss> glosses;
    std::span<Vec3f> light, shine;
    float share = 1.0f;  // of a single ray
  };
  // Replaces `light` and `shine`.
  void gather(Points at, std::uint32_t sample, Scratch& scratch) const;

  // What comes from a direction in which there is nothing.
  [[nodiscard]] Vec3f surroundings(Vec3f direction) const noexcept;

 private:
  void add_lights(const Points& at, std::uint32_t index, std::uint32_t first_dimension, Scratch& scratch) const;
  void aim_at_each(const Points& at, std::uint32_t index, std::uint32_t first_dimension, Scratch& scratch) const;
  void aim_at_some(const Points& at, std::uint32_t index, std::uint32_t first_dimension, Scratch& scratch) const;
  void aim_at_glow(const Points& at, std::uint32_t index, std::uint32_t first_dimension, Scratch& scratch) const;
  void aim(const Points& at, std::uint32_t row, const Light& light, Point2 random, float weight,
           Scratch& scratch) const;
  void add_surroundings(const Points& at, std::uint32_t index, Scratch& scratch) const;
  void add_mirrored(const Points& at, std::uint32_t index, Scratch& scratch) const;
  // Of the rays that look all around.
  [[nodiscard]] static float density_all_around(const SurfacePoint& point, Vec3f direction) noexcept;
  // Fills `arriving` with what comes along the rays of `scratch`, whose sampling places these are. openness: what part
  // of the light from all around reaches the surfaces that they meet.
  void look_along_rays(std::span<const std::uint32_t> places, std::uint32_t index, float openness,
                       Scratch& scratch) const;
  [[nodiscard]] float met_by_chance(const SurfacePoint& point, Vec3f direction, float distance,
                                    const Scratch& scratch) const noexcept;
  void light_bounces(std::uint32_t index, float openness, Scratch& scratch) const;
  [[nodiscard]] Vec3f find_mean_surroundings() const noexcept;
  // Works out how much passes what is in the way.
  void block(Scratch& scratch) const;
  void block_partly(Scratch& scratch) const;

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Appearance& appearance_;
  std::uint32_t seed_;
  int light_rays_;
  Vec3f mean_surroundings_;
  Glow glow_;
};

}  // namespace perfect_bvh
