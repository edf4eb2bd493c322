// The light of an image apart from its colours, and its smoothing: what makes one sample a pixel good to look at.
// In: for each pixel how much of the sky and of the key light arrives, relative to an open place with the same normal,
// and where its surface lies. Out: the same light, averaged with neighbours that lie on the same surface.
// Neighbouring pixels take complementary samples (see sampler.h), so a few of them together know the light well
// (interleaved sampling, Keller and Heidrich 2001). As light is kept relative to that of an open place, and apart from
// colour, the detail of normals, materials and edges is not blurred.
#pragma once

#include <span>

#include "core/aligned.h"
#include "render/sampling/camera.h"

namespace perfect_bvh {

// What one sample, or the mean of a pixel's samples, says of the light.
struct LightSample {
  Vec3f sky{0, 0, 0};     // relative to the open sky
  float key = 0.0f;       // cosine times visibility
  float key_open = 0.0f;  // cosine

  friend constexpr LightSample operator+(const LightSample& a, const LightSample& b) noexcept {
    return {a.sky + b.sky, a.key + b.key, a.key_open + b.key_open};
  }
  friend constexpr LightSample operator*(const LightSample& a, float s) noexcept {
    return {a.sky * s, a.key * s, a.key_open * s};
  }
};

// One sample's light on a surface point, and what becomes of it.
struct LitPoint {
  LightSample light;
  Vec3f color{0, 0, 0};  // what the light is multiplied with
  Vec3f lit{0, 0, 0};    // what that gives: the point's colour, or a part of it
  bool known = true;     // whether anybody has looked for that light
};

struct LightPixel {
  Vec3f normal{0, 0, 0};
  Vec3f position{0, 0, 0};  // relative to the camera
  float footprint = 0.0f;   // the size of a pixel there; 0: no surface
  Vec3f color{0, 0, 0};
  float share = 0.0f;  // of the pixel's samples that lie on this surface
  LightSample light;   // their mean

  [[nodiscard]] bool on_surface() const noexcept { return footprint > 0.0f; }
};

// Whether two points are on one smooth surface, as far as an image can tell.
[[nodiscard]] bool same_surface(const LightPixel& a, Vec3f position, Vec3f normal) noexcept;

// Buffers of one thread.
struct SmoothingScratch {
  AlignedVector<float> window, sums;
};

class DemodulatedIrradiance {
 public:
  explicit DemodulatedIrradiance(PixelRect area);

  // Different pixels may be stored from different threads.
  void store(int x, int y, const LightPixel& pixel) noexcept { pixels_[row_of(x, y)] = pixel; }

  // Replaces the light of the tile's surface pixels in `out`, a row a pixel of the tile, by an average with those up to
  // `radius` (at least 1) pixels away. The rest of `out` is the layer's.
  void smooth(PixelRect tile, int radius, SmoothingScratch& scratch, std::span<LightPixel> out) const;

 private:
  [[nodiscard]] std::size_t row_of(int x, int y) const noexcept {
    return static_cast<std::size_t>(y - area_.y0) * static_cast<std::size_t>(area_.width()) +
           static_cast<std::size_t>(x - area_.x0);
  }

  PixelRect area_;
  AlignedVector<LightPixel> pixels_;
};

}  // namespace perfect_bvh
