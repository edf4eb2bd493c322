// The targets of a render: one array per pass, for the whole image, row 0 at the top.
#pragma once

#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/sampling/camera.h"
#include "render/surface/surface.h"
#include "stats/statistics.h"

namespace perfect_bvh {

// The value of the depth passes if nothing was hit, as written by Cycles.
inline constexpr float kNoDepth = 1e10f;

// The motion of a pixel's surface, in pixels to the right and up: its position when the shutter opened minus the
// present one, and the present one minus that when it closes. These are the signs of Blender's Vector pass.
struct PixelMotion {
  float x_before, y_before, x_after, y_after;
};

// A pass that is not requested is empty; the others have a row per pixel. The caller fills them with the values for
// pixels outside the camera's border. All except `combined` and the guides hold data of the hit through the pixel's
// centre: they are never blended.
struct PassTargets {
  std::span<Rgba> combined;                     // scene-linear, premultiplied by alpha
  std::span<float> depth, distance;             // along the view axis, along the ray; kNoDepth
  std::span<Vec3f> normal;                      // shading normal, world space, towards the viewer; zero
  std::span<std::int32_t> object_index;         // the object's pass index; 0
  std::span<std::int32_t> material_index;       // the material's pass index; 0
  std::span<std::int32_t> instance, primitive;  // the scene's instance id, the triangle in its mesh; -1
  std::span<PixelMotion> vector;                // zero
  std::span<std::int32_t> nodes_visited, primitives_tested;
  // A denoiser's inputs, all or none, in addition to `combined`. The colour of samples that count in one pixel each.
  // The guides: the albedo of surfaces and their normal in world space, blended like `combined`, and seen in mirrors
  // and through panes; zero if nothing is seen.
  std::span<Rgba> denoising_color;
  std::span<Vec3f> denoising_albedo, denoising_normal;

  [[nodiscard]] bool any_guides() const noexcept { return !denoising_albedo.empty(); }
  [[nodiscard]] bool any_surface() const noexcept {
    return !depth.empty() || !distance.empty() || !normal.empty() || !object_index.empty() || !material_index.empty() ||
           !instance.empty() || !primitive.empty() || !vector.empty();
  }
  [[nodiscard]] bool any_counts() const noexcept { return !nodes_visited.empty() || !primitives_tested.empty(); }
};

// The results of one batch of rays through pixel centres: ray, hit and pixel i belong together.
struct CentreHits {
  std::span<const Pixel> pixels;
  std::span<const Ray> rays;
  std::span<const Hit> hits;
  std::span<const RayCounts> counts;     // empty if no pass needs them
  std::span<const SurfacePoint> points;  // with normals, if that pass is requested
};

// Follows rays through surfaces with less alpha than the appearance's threshold for passes, to the first that passes
// show. Their `t_min` moves on, and `hits` are the new hits. Behind more than `most_layers` surfaces, rays hit nothing.
void look_through(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                  std::span<Ray> rays, std::span<Hit> hits);

// Writes all passes except `combined`, for the pixels inside `border`.
void store_passes(const PassTargets& targets, const Snapshot& snapshot, const Appearance& appearance,
                  const ShutterRays& shutter, const PixelRect& border, int image_width, const CentreHits& found);

[[nodiscard]] inline float distance_of(const Ray& ray, float t) noexcept {
  return static_cast<float>(static_cast<double>(t) * length(ray.direction));
}

}  // namespace perfect_bvh
