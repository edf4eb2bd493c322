// The pixel filter, and the film: what samples add up to.
// In: a sample's place in its pixel and its colour. Out: pixels. The filter's shape is the Blackman-Harris window
// (Harris 1978), as in Cycles. Samples spread evenly over their pixel, and count in each pixel that the filter reaches
// from there, as Reyes did it (Cook, Carpenter and Catmull 1987): at a width of 1.5 that has 0.45 of the variance of
// samples which are drawn from the filter for one pixel alone (Ernst et al. 2006). A denoiser's guides gain as much;
// its colours are the means of pixels' own samples, so that their noise is theirs alone.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/aligned.h"
#include "core/cancel.h"
#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"
#include "render/sampling/tile_grid.h"

namespace perfect_bvh {

class PixelFilter {
 public:
  static constexpr int kFarthest = 16;  // that it may reach
  // Of the pixels from `reach` before a sample's own to `reach` after it, along one axis.
  using Weights = std::array<float, 2 * kFarthest + 1>;

  // width: the filter reaches this many pixels to each side, kFarthest at most. 0: every sample at the pixel's centre.
  explicit PixelFilter(float width);

  // From a point in [0, 1)^2 to an offset from the pixel's centre, in pixels: as densely as the filter is high.
  [[nodiscard]] Point2 offset(Point2 uniform) const noexcept { return {along_axis(uniform.x), along_axis(uniform.y)}; }

  // How many pixels to each side of its own a sample counts in, wherever it is in its own.
  [[nodiscard]] int reach() const noexcept { return reach_; }
  // offset: of a sample from its pixel's centre, along the axis, at most half a pixel.
  void weigh(float offset, Weights& weights) const noexcept;

 private:
  static constexpr int kCells = 1024;
  using Table = std::array<float, kCells + 1>;
  [[nodiscard]] static float look_up(const Table& table, float place) noexcept {
    const int cell = static_cast<int>(place);
    const float part = place - static_cast<float>(cell);
    const float low = table[static_cast<std::size_t>(cell)], high = table[static_cast<std::size_t>(cell) + 1];
    return low + (high - low) * part;
  }
  [[nodiscard]] float along_axis(float uniform) const noexcept {
    return look_up(inverse_, uniform * static_cast<float>(kCells));
  }

  float width_, cells_per_pixel_;
  int reach_;
  Table heights_{};  // from one end to the other
  Table inverse_{};  // of the cumulative distribution
};

// What samples show; the last two are a denoiser's guides.
struct FilmColor {
  Rgba color{};
  Vec3f albedo{0, 0, 0}, normal{0, 0, 0};
};

// The samples of tiles, each with the pixels around it that its samples count in. Tiles may be filled by any threads,
// and afterwards pixels be read: their sums are made in the order of the tiles.
class Film {
 public:
  Film(const TileGrid& grid, const PixelFilter& filter, bool has_guides);

  // Clears the tile's pixels.
  void begin(std::size_t tile);
  // One sample of pixels in the tile: a row a pixel. The last two are empty without guides.
  void add(std::size_t tile, std::span<const Pixel> pixels, std::span<const Point2> offsets,
           std::span<const Rgba> colors, std::span<const Vec3f> albedos, std::span<const Vec3f> normals) noexcept;
  // Of a pixel that lies so far inside of the area that all whose samples count in it do, too, or at the image's edge.
  [[nodiscard]] FilmColor pixel(int x, int y) const noexcept;

 private:
  struct Sum {
    Rgba color;
    float weight = 0.0f;
  };
  struct Guides {
    Vec3f albedo{0, 0, 0}, normal{0, 0, 0};
  };
  // The tile's first pixel is `reach` rows and columns further on.
  [[nodiscard]] std::size_t stride() const noexcept { return static_cast<std::size_t>(kTileSize + 2 * reach_); }

  TileGrid grid_;
  const PixelFilter& filter_;
  int reach_;
  bool has_guides_;
  std::vector<AlignedVector<Sum>> tiles_;
  std::vector<AlignedVector<Guides>> guides_;  // as large, or empty
};

// Joint filter --------------------------------------------------------------------------------------------------------
// A denoiser that needs no other library: the noisy light of an image is averaged with that of pixels whose surface is
// alike, as the albedo and the normal of each pixel tell.
// In: scene-linear colours, and what guides it. Out: the same colours with less noise, in each pixel the same bits for
// any number of threads. Light is filtered apart from albedo, so that textures stay sharp, by an edge-avoiding a-trous
// wavelet (Dammertz et al. 2010, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering")
// whose tolerance for other brightness follows from the noise that each neighbourhood shows (Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering", its spatial half): what has no noise is left as it is.

// Rows of `width` pixels, the same number in each image. albedo and normal may be empty: then nothing is known of them.
struct JointFilterImages {
  int width = 0;
  int height = 0;
  std::span<const Vec3f> color;   // finite
  std::span<const Vec3f> albedo;  // finite; means of a pixel's samples, as is the normal
  std::span<const Vec3f> normal;  // finite; zero where there is no surface
  std::span<Vec3f> out;           // another memory than `color`
};

// At most `max_threads` threads of the shared pool, 0 for all. Throws Cancelled, and what the token's callback does.
void joint_filter(const JointFilterImages& images, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
