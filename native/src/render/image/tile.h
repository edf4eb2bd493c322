// A random subset of an image's camera rays and their hits, to check the renderer's answers.
// In: batches of rays and hits, from any thread. Out: the selected ones, in the order of pixels and samples. The
// selection depends only on seed, pixel and sample, not on tiles or threads.
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
  // share: of all rays, from 0 to 1.
  RaySubset(float share, std::uint32_t seed) noexcept;

  // Offers one sample of some pixels: ray i and hit i belong to pixel i.
  void offer(const Snapshot& snapshot, std::uint32_t sample, std::span<const Pixel> pixels, std::span<const Ray> rays,
             std::span<const Hit> hits);
  [[nodiscard]] std::vector<SubsetRay> take();

 private:
  std::uint64_t limit_;  // of 2^32 values
  std::uint32_t seed_;
  std::vector<SubsetRay> kept_;
  std::mutex mutex_;
};

// Tile ----------------------------------------------------------------------------------------------------------------
// One tile of an image: camera rays in a batch, their hits, the passes, and the requested number of shaded samples.
// In: a rectangle of pixels. Out: every requested pass of those pixels. Nothing depends on other tiles or on threads.

// Buffers of one thread, kept from tile to tile.
struct TileScratch {
  AlignedVector<Pixel> pixels;
  AlignedVector<std::uint32_t> places;  // of the pixels; they select their random numbers
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<Ray> pass_rays;  // the hits that passes show, if they differ from the rays' hits
  AlignedVector<Hit> pass_hits;
  AlignedVector<RayCounts> counts;
  AlignedVector<SurfacePoint> points;
  AlignedVector<Rgba> colors, sums;
  AlignedVector<Vec3f> albedos, normals, albedo_sums, normal_sums;  // if a denoiser's guides are requested
  AlignedVector<Point2> offsets;  // of samples relative to the centres of their pixels
  ShadeScratch shade;
  MaterialReader materials;  // if nodes bend normals
};

class TileRenderer {
 public:
  // Camera rays are offered to `kept`, which must outlive this, as must the shutter.
  TileRenderer(const ModeInputs& inputs, const ShutterRays& shutter, PixelRect border, const PassTargets& targets,
               RaySubset& kept);

  // The tiles of the pixels to render: those in the border, and those around it that the pixel filter reads.
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

  // Returns whether `finish` has work after every tile of the image is rendered.
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

  // Returns whether the tile that contains a pixel is traced.
  [[nodiscard]] bool is_wanted(int x, int y) const noexcept {
    const auto& wanted = inputs_.settings.wanted_tiles;
    if (wanted.empty()) return true;
    const std::size_t row = static_cast<std::size_t>(y / kTileSize) * tile_count(inputs_.settings.width);
    return wanted[row + static_cast<std::size_t>(x / kTileSize)] != 0;
  }
  [[nodiscard]] bool is_wanted(PixelRect whole_tile) const noexcept { return is_wanted(whole_tile.x0, whole_tile.y0); }
  [[nodiscard]] bool is_needed(int x, int y) const noexcept;

  // A denoiser assumes independent pixels. It would keep noise that neighbours share, and noise that is arranged to
  // cancel out is harder for it to detect (cloth, 4 samples: an error of 1.94 instead of 1.80). So the pixels' random
  // numbers are in no order, and the denoiser's input is separate from the film.
  [[nodiscard]] bool are_apart() const noexcept { return targets_.any_guides(); }
  // Returns how many pixels away samples count.
  [[nodiscard]] int shared_reach() const noexcept { return centred_ ? 0 : filter_.reach(); }
  // Returns whether the rays of the passes are also those of the only sample.
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
  bool centred_;  // samples are at pixel centres
  // Samples cover the whole lens and the whole time that the shutter is open; passes use the middle of both.
  bool has_lens_, has_shutter_;
  PixelRect border_;
  TileGrid tiles_;
  mutable std::optional<Film> film_;  // if pixels share samples
  bool wants_centres_;                // rays through pixel centres are needed for the passes
};

}  // namespace perfect_bvh
