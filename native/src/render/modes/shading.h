// Render settings: plain values, filled by the caller.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "core/cancel.h"
#include "math/elementary.h"
#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/light/next_event.h"
#include "render/light/path_tracer.h"
#include "render/sampling/camera.h"
#include "render/surface/surface.h"
#include "stats/statistics.h"
#include "traverse/ray.h"

namespace perfect_bvh {

enum class Mode : std::uint8_t {
  kPreview,
  kClay,
  kMatcap,
  kWireframe,
  kNormal,
  kUv,
  kDepth,
  kDistance,
  kInstance,
  kMaterial,
  kCost,
};

struct ClaySettings {
  float ao_distance = 0.0f;    // world units; 0: from the size of the scene
  int light_rays = 1;          // towards the sky and towards the key light, for each camera sample
  std::optional<Vec3f> color;  // replaces the materials' colours; matcap and wireframe use it, too
};

struct WireframeSettings {
  float width = 1.0f;  // pixels
  Vec3f color{0.02f, 0.02f, 0.025f};
};

struct RenderSettings {
  Mode mode = Mode::kClay;
  int width = 960, height = 540;
  std::uint32_t samples = 1, first_sample = 0;
  bool is_continued = false;  // whether more samples follow; if not, a single one is at the pixel's centre
  float filter_width = 1.5f;  // pixels to each side
  std::uint32_t seed = 0;
  int threads = 0;          // 0: all
  float kept_share = 0.0f;  // of the camera rays, for checks: see RaySubset
  // The tiles of the image to trace, row by row; 0 for skipped tiles. All if empty. See TileGrid.
  std::span<const std::uint8_t> wanted_tiles;
  std::optional<Shutter> shutter;  // empty: the scene is still, as when the shutter opens
  LightPaths light_paths;          // of the mode kPreview
  ClaySettings clay;
  WireframeSettings wireframe;
};

// Palette -------------------------------------------------------------------------------------------------------------
// Colours for numbers: distinct ones for ids, an even ramp for amounts.
// Both are defined in Oklab (Ottosson 2020), in which equal steps look equal, and returned encoded for the screen
// (sRGB): they are codes, to be shown and stored unchanged.

// Makes a colour from Oklab's lightness (0..1), chroma and hue (in turns), with as much of the chroma as the screen can
// show.
[[nodiscard]] Vec3f color_from_lch(double lightness, double chroma, double hue) noexcept;

// Returns a fixed colour for each id; neighbouring ids look different.
[[nodiscard]] Vec3f id_color(std::uint32_t id) noexcept;

// From deep violet (0) through red and orange to pale yellow (1), its lightness rising evenly.
class ColorRamp {
 public:
  ColorRamp();
  [[nodiscard]] Vec3f at(float amount) const noexcept;

 private:
  static constexpr int kCells = 128;
  std::array<Vec3f, kCells + 1> colors_;
};

// The scale of the mode "cost": logarithmic, eight doublings from 2 (violet) to 512 (pale yellow), for all scenes.
inline constexpr float kLeastCost = 2.0f;
inline constexpr float kCostDoublings = 8.0f;

// cost: nodes visited plus triangles tested.
[[nodiscard]] inline Vec3f cost_color(const ColorRamp& ramp, float cost) noexcept {
  return ramp.at(static_cast<float>(logarithm2(static_cast<double>(std::max(cost, 1.0f) / kLeastCost))) /
                 kCostDoublings);
}

// Shading -------------------------------------------------------------------------------------------------------------
// The interface of a shading mode: hits in, colours out, a whole batch at a time.
// The tile loop traces camera rays, finds the surfaces with the data that the mode needs, and passes both to the mode,
// which may trace further rays in its own batches. There is one virtual call per tile and sample. Each mode has a file;
// those that show a number of each hit are in data.cpp.

// The light that reaches a point in the clay mode's studio.
struct StudioLight {
  Vec3f sky{0, 0, 0};  // relative to the open sky
  float key = 0.0f;    // cosine times visibility
};

// Buffers of one thread, kept from tile to tile so that nothing is allocated once they have grown.
struct ShadeScratch {
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint32_t> targets;  // for each ray, the row in ShadeTask::points
  AlignedVector<StudioLight> lights;     // one row per point
  PathTracer::Scratch paths, caught_paths;
  AlignedVector<Rgba> caught_light, open_light;  // one row per point on a shadow catcher
};

struct ShadeTask {
  std::uint32_t sample;
  std::span<const std::uint32_t> places;  // of the rays; they select their random numbers
  std::span<const Ray> rays;
  std::span<const Hit> hits;
  std::span<const RayCounts> counts;     // empty unless the mode needs them
  std::span<const SurfacePoint> points;  // hits that are not holdouts
  std::span<Rgba> colors;                // of the rays; initially the background if nothing was hit, else zero
  std::span<Vec3f> albedos, normals;     // of the rays, initially zero: a denoiser's guides; empty unless requested
  ShadeScratch& scratch;
};

class ShadingMode {
 public:
  virtual ~ShadingMode() = default;
  // Writes `colors`, including alpha, of the rays that belong to `points`.
  virtual void shade(const ShadeTask& task) const = 0;

  [[nodiscard]] virtual SurfaceNeeds needs() const noexcept { return {}; }
  [[nodiscard]] virtual bool wants_counts() const noexcept { return false; }
  // Returns whether `shade` writes a denoiser's guides itself: they then show what is seen in mirrors and through
  // panes.
  [[nodiscard]] virtual bool has_guides() const noexcept { return false; }
  // Returns true for numbers that must not be blended: always one sample at the pixel's centre.
  [[nodiscard]] virtual bool is_exact() const noexcept { return false; }
  // Returns whether blur is rendered: out of focus if the camera has a lens, and of motion if it has a shutter.
  [[nodiscard]] virtual bool is_photograph() const noexcept { return false; }
  // Returns whether there is something behind the surfaces. The next function returns its colour in the direction of a
  // camera ray; x and y are the position in the frame, from the upper left (0, 0) to the lower right (1, 1).
  [[nodiscard]] virtual bool has_backdrop() const noexcept { return false; }
  [[nodiscard]] virtual Vec3f backdrop(const Ray& /*ray*/, float /*x*/, float /*y*/) const { return {0, 0, 0}; }
};

// The inputs of modes, which must outlive them.
struct ModeInputs {
  const Snapshot& snapshot;
  const Appearance& appearance;
  const RayMaker& camera;
  const RenderSettings& settings;
  CancelToken& cancel;
};

[[nodiscard]] std::unique_ptr<ShadingMode> make_preview_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_clay_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_matcap_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_normal_mode();
[[nodiscard]] std::unique_ptr<ShadingMode> make_uv_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_depth_mode();
[[nodiscard]] std::unique_ptr<ShadingMode> make_distance_mode();
[[nodiscard]] std::unique_ptr<ShadingMode> make_instance_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_material_mode();
[[nodiscard]] std::unique_ptr<ShadingMode> make_wireframe_mode(const ModeInputs& inputs);
[[nodiscard]] std::unique_ptr<ShadingMode> make_cost_mode();
[[nodiscard]] std::unique_ptr<ShadingMode> make_mode(const ModeInputs& inputs);

}  // namespace perfect_bvh
