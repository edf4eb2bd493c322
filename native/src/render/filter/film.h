// The pixel filter, and the film, which sums samples.
// In: a sample's position in its pixel and its colour. Out: pixels. The filter's shape is the Blackman-Harris window
// (Harris 1978), as in Cycles. Samples are uniform over their pixel, and count in each pixel that the filter reaches
// from there, as in Reyes (Cook, Carpenter and Catmull 1987). At a width of 1.5 that has 0.45 of the variance of
// samples that are drawn from the filter for only one pixel (Ernst et al. 2006). A denoiser's guides gain as much. Its
// colours are the means of pixels' own samples, so that their noise is independent.
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
  static constexpr int kFarthest = 16;  // the maximum reach
  // The weights of the pixels from `reach` before a sample's own to `reach` after it, along one axis.
  using Weights = std::array<float, 2 * kFarthest + 1>;

  // width: the filter reaches this many pixels to each side, at most kFarthest. 0: every sample is at the pixel's
  // centre.
  explicit PixelFilter(float width);

  // Maps a point in [0, 1)^2 to an offset from the pixel's centre, in pixels, with the filter as density.
  [[nodiscard]] Point2 offset(Point2 uniform) const noexcept { return {along_axis(uniform.x), along_axis(uniform.y)}; }

  // Returns the number of pixels on each side in which a sample may count, for any position in its own pixel.
  [[nodiscard]] int reach() const noexcept { return reach_; }
  // offset: a sample's distance from its pixel's centre, along the axis, at most half a pixel.
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

// A sample's colour; the last two are a denoiser's guides.
struct FilmColor {
  Rgba color{};
  Vec3f albedo{0, 0, 0}, normal{0, 0, 0};
};

// The samples of tiles, with the pixels around each tile in which its samples count. Any threads may fill tiles.
// Afterwards, pixels can be read: sums are made in the order of the tiles.
class Film {
 public:
  Film(const TileGrid& grid, const PixelFilter& filter, bool has_guides);

  // Clears the tile's pixels.
  void begin(std::size_t tile);
  // Adds one sample of pixels in the tile, one row per pixel. The last two are empty without guides.
  void add(std::size_t tile, std::span<const Pixel> pixels, std::span<const Point2> offsets,
           std::span<const Rgba> colors, std::span<const Vec3f> albedos, std::span<const Vec3f> normals) noexcept;
  // The pixel must be far enough inside the area that all pixels whose samples count in it are inside too, or are cut
  // off by the image's edge.
  [[nodiscard]] FilmColor pixel(int x, int y) const noexcept;

 private:
  struct Sum {
    Rgba color;
    float weight = 0.0f;
  };
  struct Guides {
    Vec3f albedo{0, 0, 0}, normal{0, 0, 0};
  };
  // The tile's first pixel is offset by `reach` rows and columns.
  [[nodiscard]] std::size_t stride() const noexcept { return static_cast<std::size_t>(kTileSize + 2 * reach_); }

  TileGrid grid_;
  const PixelFilter& filter_;
  int reach_;
  bool has_guides_;
  std::vector<AlignedVector<Sum>> tiles_;
  std::vector<AlignedVector<Guides>> guides_;  // of the same size, or empty
};

// Joint filter --------------------------------------------------------------------------------------------------------
// A denoiser that needs no other library: the noisy light of a pixel is averaged with that of pixels with a similar
// surface, according to albedo and normal.
// In: scene-linear colours, and guides. Out: the same colours with less noise, the same bits for any number of threads.
// Light is filtered separately from albedo, so that textures stay sharp, by an edge-avoiding a-trous wavelet (Dammertz
// et al. 2010, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering"). Its tolerance for
// other brightness depends on the noise of each neighbourhood (Schied et al. 2017, "Spatiotemporal Variance-Guided
// Filtering", its spatial half): colours without noise do not change.

// Rows of `width` pixels, the same number in each image. albedo and normal may be empty if they are unknown.
struct JointFilterImages {
  int width = 0;
  int height = 0;
  std::span<const Vec3f> color;   // finite
  std::span<const Vec3f> albedo;  // finite; means of a pixel's samples, as is the normal
  std::span<const Vec3f> normal;  // finite; zero without a surface
  std::span<Vec3f> out;           // must not overlap `color`
};

// Uses at most `max_threads` threads of the shared pool, 0 for all. Throws Cancelled, and exceptions of the token's
// callback.
void joint_filter(const JointFilterImages& images, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
