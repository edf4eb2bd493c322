// Collects a tile's light sample by sample, for the first surface that each pixel shows; most show no other.
// In: the points that each sample hit, and the light there. Out: a LightPixel for each pixel, and what is left of its
// colour: the samples on other surfaces and on none.
#pragma once

#include <span>

#include "render/filter/irradiance.h"
#include "render/sampling/camera.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

class IrradianceAccumulation {
 public:
  void begin(std::size_t pixel_count);
  // One sample of every pixel: ray i belongs to pixel i. lit_points: a row a point.
  void add(const RayMaker& camera, std::span<const Ray> rays, std::span<const Hit> hits,
           std::span<const SurfacePoint> points, std::span<const LitPoint> lit_points);
  // Of `sample_count` samples.
  [[nodiscard]] LightPixel pixel(std::size_t index, std::uint32_t sample_count) const noexcept;
  // The part of the sum of the samples' colours that is not lit by that light.
  [[nodiscard]] Vec3f rest(std::size_t index, const Rgba& sum) const noexcept;

 private:
  struct Entry {
    LightPixel pixel;         // position and normal of the first sample, sums of light and colour
    Vec3f lit{0, 0, 0};       // sum of the lit colours
    std::uint32_t count = 0;  // samples on the surface of the first
  };
  AlignedVector<Entry> entries_;
};

}  // namespace perfect_bvh
