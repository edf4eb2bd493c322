// What to render and how: plain values, filled by the caller.
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
  std::optional<Vec3f> color;  // instead of the materials' colours; matcap and wireframe take it, too
};

struct WireframeSettings {
  float width = 1.0f;  // pixels
  Vec3f color{0.02f, 0.02f, 0.025f};
};

struct RenderSettings {
  Mode mode = Mode::kClay;
  int width = 960, height = 540;
  std::uint32_t samples = 1, first_sample = 0;
  bool is_continued = false;  // whether other samples follow; if not, a single one stands at the pixel's centre
  float filter_width = 1.5f;  // pixels to each side
  std::uint32_t seed = 0;
  int threads = 0;          // 0: all
  float kept_share = 0.0f;  // of the camera rays, to be checked: see RaySubset
  // Which tiles of the image to trace, row by row, 0 for those to leave out; all if empty. See TileGrid.
  std::span<const std::uint8_t> wanted_tiles;
  std::optional<Shutter> shutter;  // none: the scene stands still where it would open
  LightPaths light_paths;          // of the mode kPreview
  ClaySettings clay;
  WireframeSettings wireframe;
};

// Palette -------------------------------------------------------------------------------------------------------------
// Colours for numbers: distinct ones for ids, an even ramp for amounts.
// Both are laid out in Oklab (Ottosson 2020), where equal steps look equal, and handed out encoded for the screen
// (sRGB): they are codes, to be shown and stored as they are.

// From Oklab's lightness (0..1), chroma and hue (in turns), with as much of the chroma as the screen can show.
[[nodiscard]] Vec3f color_from_lch(double lightness, double chroma, double hue) noexcept;

// The same colour for the same id, always; neighbouring ids look unlike.
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

// The scale of the mode "cost": logarithmic, eight doublings from 2 (violet) to 512 (pale yellow), whatever the scene.
inline constexpr float kLeastCost = 2.0f;
inline constexpr float kCostDoublings = 8.0f;

// cost: nodes visited plus triangles tested.
[[nodiscard]] inline Vec3f cost_color(const ColorRamp& ramp, float cost) noexcept {
  return ramp.at(static_cast<float>(logarithm2(static_cast<double>(std::max(cost, 1.0f) / kLeastCost))) /
                 kCostDoublings);
}

// Shading -------------------------------------------------------------------------------------------------------------
// What a shading mode is: hits in, colours out, a whole batch at a time.
// The tile loop traces camera rays, finds the surfaces with what the mode needs, and hands both over; the mode may
// trace further rays in batches of its own. One virtual call a tile and sample. One file a mode;
// those that show a number of each hit are in data.cpp.

// What reaches a point in the clay mode's studio.
struct StudioLight {
  Vec3f sky{0, 0, 0};  // relative to the open sky
  float key = 0.0f;    // cosine times visibility
};

// Buffers of one thread, kept from tile to tile so that nothing is allocated once they have grown.
struct ShadeScratch {
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint32_t> targets;  // rows in ShadeTask::points that the rays belong to
  AlignedVector<StudioLight> lights;     // a row a point
  PathTracer::Scratch paths, caught_paths;
  AlignedVector<Rgba> caught_light, open_light;  // a row a point on a shadow catcher
};

struct ShadeTask {
  std::uint32_t sample;
  std::span<const std::uint32_t> places;  // of the rays: by which their random numbers differ
  std::span<const Ray> rays;
  std::span<const Hit> hits;
  std::span<const RayCounts> counts;     // empty unless the mode wants them
  std::span<const SurfacePoint> points;  // hits that are not holdouts
  std::span<Rgba> colors;                // of the rays; the background where nothing was hit, else zero
  std::span<Vec3f> albedos, normals;     // of the rays, zero: what guides a denoiser; empty unless wanted
  ShadeScratch& scratch;
};

class ShadingMode {
 public:
  virtual ~ShadingMode() = default;
  // Writes `colors` of the rays that belong to `points`, alpha included.
  virtual void shade(const ShadeTask& task) const = 0;

  [[nodiscard]] virtual SurfaceNeeds needs() const noexcept { return {}; }
  [[nodiscard]] virtual bool wants_counts() const noexcept { return false; }
  // Whether `shade` writes what guides a denoiser itself: it is then what is seen in mirrors and through panes.
  [[nodiscard]] virtual bool has_guides() const noexcept { return false; }
  // True for numbers that must not be blended: one sample at the pixel's centre, whatever was asked for.
  [[nodiscard]] virtual bool is_exact() const noexcept { return false; }
  // Whether what is out of focus is blurred, if the camera has a lens, and what moves, if it has a shutter.
  [[nodiscard]] virtual bool is_photograph() const noexcept { return false; }
  // Whether something stands behind the surfaces, and its colour in the direction of a camera ray; x and y are the
  // place in the frame, from the upper left (0, 0) to the lower right (1, 1).
  [[nodiscard]] virtual bool has_backdrop() const noexcept { return false; }
  [[nodiscard]] virtual Vec3f backdrop(const Ray& /*ray*/, float /*x*/, float /*y*/) const { return {0, 0, 0}; }
};

// What modes are made from; all of it outlives them.
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
