// One tile of an image: camera rays in a batch, their hits, the passes, and as many shaded samples as are asked for.
// In: a rectangle of pixels. Out: every wanted pass of those pixels. Nothing depends on other tiles or on threads.
#pragma once

#include "core/cancel.h"
#include "render/film.h"
#include "render/kept_rays.h"
#include "render/light_gather.h"
#include "render/passes.h"
#include "render/shading.h"

namespace perfect_bvh {

inline constexpr int kTileSize = 32;

// Buffers of one thread, kept from tile to tile.
struct TileScratch {
  AlignedVector<Pixel> pixels;
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<RayCounts> counts;
  AlignedVector<SurfacePoint> points;
  AlignedVector<Rgba> colors, sums;
  ShadeScratch shade;
  LightGather gather;
  SmoothingScratch smoothing;
  AlignedVector<LightPixel> lights;
};

class TileRenderer {
 public:
  // Camera rays are offered to `kept`, which outlives this.
  TileRenderer(const ModeInputs& inputs, PixelRect border, const PassTargets& targets, KeptRays& kept);

  // The pixels to render: those in the border, and as many around it as smoothing looks at.
  [[nodiscard]] PixelRect area() const noexcept { return area_; }

  // Throws Cancelled between samples. `between_samples` is called on the same thread.
  template <class Idle>
  void render(PixelRect tile, TileScratch& scratch, const CancelToken& cancel, const Idle& between_samples) const {
    place_pixels(tile, scratch);
    if (wants_centres_) trace_centres(scratch);
    if (targets_.combined.empty()) return;
    scratch.sums.assign(scratch.pixels.size(), Rgba{});
    if (layer_) scratch.gather.begin(scratch.pixels.size());
    for (std::uint32_t sample = 0; sample < sample_count_; ++sample) {
      cancel.throw_if_stopped();
      add_sample(sample, scratch);
      between_samples();
    }
    store_combined(scratch);
  }

  // Whether `finish` has work, once every tile of the image is rendered.
  [[nodiscard]] bool needs_finish() const noexcept { return layer_.has_value(); }
  void finish(PixelRect tile, TileScratch& scratch) const;

 private:
  void place_pixels(PixelRect tile, TileScratch& scratch) const;
  void trace_centres(TileScratch& scratch) const;
  void trace(TileScratch& scratch, std::uint32_t sample, bool with_counts) const;
  void add_sample(std::uint32_t sample, TileScratch& scratch) const;
  void make_rays(std::uint32_t sample, TileScratch& scratch) const;
  void fill_background(TileScratch& scratch) const;
  void store_combined(const TileScratch& scratch) const;
  void store_light(const TileScratch& scratch) const;

  [[nodiscard]] std::size_t row_of(Pixel pixel) const noexcept {
    return static_cast<std::size_t>(pixel.y) * static_cast<std::size_t>(inputs_.settings.width) + pixel.x;
  }

  ModeInputs inputs_;
  PassTargets targets_;
  KeptRays& kept_;
  std::unique_ptr<ShadingMode> mode_;
  PixelFilter filter_;
  Dimension filter_dimension_;
  SurfaceNeeds pass_needs_;
  std::uint32_t sample_count_;
  bool centred_;          // samples stand at pixel centres
  int smoothing_radius_;  // 0: none
  PixelRect border_, area_;
  mutable std::optional<LightLayer> layer_;
  bool wants_centres_;  // rays through pixel centres are needed for the passes
};

}  // namespace perfect_bvh
