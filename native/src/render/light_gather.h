// Collects a tile's light sample by sample, and finds out which pixels show one smooth surface only.
// In: the points that each sample hit, and the light there. Out: a LightPixel and a mean colour for each pixel.
#pragma once

#include <span>

#include "render/camera.h"
#include "render/light_layer.h"
#include "render/surface.h"

namespace perfect_bvh {

class LightGather {
 public:
  void begin(std::size_t pixel_count);
  // One sample of every pixel: ray i belongs to pixel i. lights: a row a point.
  void add(const RayMaker& camera, std::span<const Ray> rays, std::span<const Hit> hits,
           std::span<const SurfacePoint> points, std::span<const LightSample> lights);
  // The means over `sample_count` samples.
  [[nodiscard]] LightPixel pixel(std::size_t index, std::uint32_t sample_count) const noexcept;
  [[nodiscard]] Vec3f color(std::size_t index, std::uint32_t sample_count) const noexcept;

 private:
  struct Entry {
    LightPixel pixel;  // position and normal of the first sample, sum of the light
    Vec3f color{0, 0, 0};
    std::uint32_t count = 0;  // samples that agree with the first
  };
  AlignedVector<Entry> entries_;
};

}  // namespace perfect_bvh
