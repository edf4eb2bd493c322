// A random share of an image's camera rays, with what each hit: for checks of the renderer's answers.
// In: batches of rays and hits, from any thread. Out: those whose lot it was, in the order of pixels and samples. Which
// rays that are follows from seed, pixel and sample alone, so that it does not depend on tiles or threads.
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "core/cancel.h"
#include "render/filter/film.h"
#include "render/modes/passes.h"
#include "render/modes/shading.h"
#include "render/sampling/camera.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct SubsetRay {
  Pixel pixel;
  std::uint32_t sample;
  Ray ray;
  float t;  // infinite on a miss
  std::int32_t instance_id, primitive_id;
};

class RaySubset {
 public:
  // share: 0 to 1 of all rays.
  RaySubset(float share, std::uint32_t seed) noexcept;

  // One sample of some pixels: ray i and hit i belong to pixel i.
  void offer(const Snapshot& snapshot, std::uint32_t sample, std::span<const Pixel> pixels, std::span<const Ray> rays,
             std::span<const Hit> hits);
  [[nodiscard]] std::vector<SubsetRay> take();

 private:
  std::uint64_t limit_;  // of 2^32 lots
  std::uint32_t seed_;
  std::vector<SubsetRay> kept_;
  std::mutex mutex_;
};

// Tile ----------------------------------------------------------------------------------------------------------------
// One tile of an image: camera rays in a batch, their hits, the passes, and as many shaded samples as are asked for.
// In: a rectangle of pixels. Out: every wanted pass of those pixels. Nothing depends on other tiles or on threads.

// Buffers of one thread, kept from tile to tile.
struct TileScratch {
  AlignedVector<Pixel> pixels;
  AlignedVector<std::uint32_t> places;  // of the pixels, by which their random numbers differ
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<Ray> pass_rays;  // what passes show, where that is not all that rays hit
  AlignedVector<Hit> pass_hits;
  AlignedVector<RayCounts> counts;
  AlignedVector<SurfacePoint> points;
  AlignedVector<Rgba> colors, sums;
  AlignedVector<Vec3f> albedos, normals, albedo_sums, normal_sums;  // if a denoiser's guides are wanted
  AlignedVector<Point2> offsets;                                    // of samples from the centres of their pixels
  ShadeScratch shade;
  MaterialReader materials;  // if they bend normals
};

class TileRenderer {
 public:
  // Camera rays are offered to `kept`; that and the shutter outlive this.
  TileRenderer(const ModeInputs& inputs, const ShutterRays& shutter, PixelRect border, const PassTargets& targets,
               RaySubset& kept);

  // Of the pixels to render: those in the border, and as many around it as the pixel filter looks at.
  [[nodiscard]] const TileGrid& tiles() const noexcept { return tiles_; }

  // Throws Cancelled between samples. `between_samples` is called on the same thread.
  template <class Idle>
  void render(std::size_t tile, TileScratch& scratch, const CancelToken& cancel, const Idle& between_samples) const {
    place_pixels(tile, scratch);
    if (scratch.pixels.empty()) return;
    if (wants_centres_ && is_wanted(tiles_.whole_at(tile))) trace_centres(scratch);
    if (targets_.combined.empty()) return;
    begin(tile, scratch);
    for (std::uint32_t sample = 0; sample < sample_count_; ++sample) {
      cancel.throw_if_stopped();
      add_sample(sample, tile, scratch);
      between_samples();
    }
    if (!film_ || are_apart()) store_own(scratch);
  }

  // Whether `finish` has work, once every tile of the image is rendered.
  [[nodiscard]] bool needs_finish() const noexcept { return film_.has_value(); }
  void finish(std::size_t tile) const;

 private:
  void begin(std::size_t tile, TileScratch& scratch) const;
  void place_pixels(std::size_t tile, TileScratch& scratch) const;
  void trace_centres(TileScratch& scratch) const;
  void store_centres(TileScratch& scratch) const;
  void trace(TileScratch& scratch, std::uint32_t sample, bool with_counts) const;
  void add_sample(std::uint32_t sample, std::size_t tile, TileScratch& scratch) const;
  void add_guides(TileScratch& scratch) const;
  void make_rays(std::uint32_t sample, TileScratch& scratch) const;
  void fill_background(TileScratch& scratch) const;
  void store_own(const TileScratch& scratch) const;

  // Whether the tile that holds a pixel is to be traced.
  [[nodiscard]] bool is_wanted(int x, int y) const noexcept {
    const auto& wanted = inputs_.settings.wanted_tiles;
    if (wanted.empty()) return true;
    const std::size_t row = static_cast<std::size_t>(y / kTileSize) * tile_count(inputs_.settings.width);
    return wanted[row + static_cast<std::size_t>(x / kTileSize)] != 0;
  }
  [[nodiscard]] bool is_wanted(PixelRect whole_tile) const noexcept { return is_wanted(whole_tile.x0, whole_tile.y0); }
  [[nodiscard]] bool is_needed(int x, int y) const noexcept;

  // A denoiser takes pixels for independent. Noise that neighbours share would look like something to be kept, and such
  // as they have been given to cancel out is less easy to tell (cloth, 4 samples: an error of 1.94 in place of 1.80).
  // So random numbers differ by pixel without any order, and what it takes is kept apart from the film.
  [[nodiscard]] bool are_apart() const noexcept { return targets_.any_guides(); }
  // How far samples count in other pixels.
  [[nodiscard]] int shared_reach() const noexcept { return centred_ ? 0 : filter_.reach(); }
  // Whether the rays of the passes are those of the only sample, too.
  [[nodiscard]] bool shades_centres() const noexcept {
    return centred_ && wants_centres_ && !has_lens_ && !has_shutter_ && !targets_.combined.empty();
  }
  [[nodiscard]] std::size_t row_of(Pixel pixel) const noexcept {
    return static_cast<std::size_t>(pixel.y) * static_cast<std::size_t>(inputs_.settings.width) + pixel.x;
  }

  ModeInputs inputs_;
  const ShutterRays& shutter_;
  PassTargets targets_;
  RaySubset& kept_;
  std::unique_ptr<ShadingMode> mode_;
  PixelFilter filter_;
  Dimension filter_dimension_, lens_dimension_, time_dimension_;
  SurfaceNeeds pass_needs_, sample_needs_;
  std::uint32_t sample_count_;
  bool centred_;  // samples stand at pixel centres
  // Samples pass all of the lens and take all the time that the shutter is open; passes the middle of both.
  bool has_lens_, has_shutter_;
  PixelRect border_;
  TileGrid tiles_;
  mutable std::optional<Film> film_;  // if pixels share samples
  bool wants_centres_;                // rays through pixel centres are needed for the passes
};

}  // namespace perfect_bvh
