// What a shading mode is: hits in, colours out, a whole batch at a time.
// The tile loop traces camera rays, finds the surfaces with what the mode needs, and hands both over; the mode may
// trace further rays in batches of its own. One virtual call a tile and sample. One file a mode;
// those that show a number of each hit are in mode_data.cpp.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/light/path_tracer.h"
#include "render/modes/settings.h"
#include "render/sampling/camera.h"
#include "render/surface/surface.h"
#include "stats/ray_counts.h"

namespace perfect_bvh {

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
