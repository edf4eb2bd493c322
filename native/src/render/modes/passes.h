// Where a render's results go: one array a pass, of the whole image, row 0 on top.
#pragma once

#include <cstdint>
#include <span>

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/sampling/camera.h"
#include "render/surface/surface.h"
#include "stats/statistics.h"

namespace perfect_bvh {

// What the depth passes hold where nothing was hit: the number that Cycles writes.
inline constexpr float kNoDepth = 1e10f;

// How far, in pixels to the right and up, what a pixel shows is from where it was when the shutter opened, and will be
// when it closes, taken from there to here: the sign that Blender's Vector pass has.
struct PixelMotion {
  float x_before, y_before, x_after, y_after;
};

// A pass that is not wanted is empty; the others have a row a pixel. The caller fills them with what pixels outside the
// camera's border get. All but `combined` and the guides hold what the ray through the pixel's centre hit: they are
// never blended.
struct PassTargets {
  std::span<Rgba> combined;                     // scene-linear, premultiplied by alpha
  std::span<float> depth, distance;             // along the view axis, along the ray; kNoDepth
  std::span<Vec3f> normal;                      // shading normal, world space, towards the viewer; zero
  std::span<std::int32_t> object_index;         // the object's pass index; 0
  std::span<std::int32_t> material_index;       // the material's pass index; 0
  std::span<std::int32_t> instance, primitive;  // the scene's instance id, the triangle in its mesh; -1
  std::span<PixelMotion> vector;                // zero
  std::span<std::int32_t> nodes_visited, primitives_tested;
  // What a denoiser takes, all or none of it, beside `combined`: the colour of samples that count in one pixel each,
  // and what guides it: the share of light that surfaces give back and their normal in world space, as much blended as
  // `combined`, and seen in mirrors and through panes; zero where nothing is seen.
  std::span<Rgba> denoising_color;
  std::span<Vec3f> denoising_albedo, denoising_normal;

  [[nodiscard]] bool any_guides() const noexcept { return !denoising_albedo.empty(); }
  [[nodiscard]] bool any_surface() const noexcept {
    return !depth.empty() || !distance.empty() || !normal.empty() || !object_index.empty() || !material_index.empty() ||
           !instance.empty() || !primitive.empty() || !vector.empty();
  }
  [[nodiscard]] bool any_counts() const noexcept { return !nodes_visited.empty() || !primitives_tested.empty(); }
};

// What one batch of rays through pixel centres found: ray, hit and pixel i belong together.
struct CentreHits {
  std::span<const Pixel> pixels;
  std::span<const Ray> rays;
  std::span<const Hit> hits;
  std::span<const RayCounts> counts;     // empty if no pass wants them
  std::span<const SurfacePoint> points;  // with normals, if that pass is wanted
};

// Follows rays through what has less alpha than the appearance's passes show, to what they do show: their `t_min` moves
// on, and `hits` are what they meet from there. Behind more than `most_layers` surfaces they meet nothing.
void look_through(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                  std::span<Ray> rays, std::span<Hit> hits);

// Writes all passes but `combined` of the pixels that lie inside `border`.
void store_passes(const PassTargets& targets, const Snapshot& snapshot, const Appearance& appearance,
                  const ShutterRays& shutter, const PixelRect& border, int image_width, const CentreHits& found);

[[nodiscard]] inline float distance_of(const Ray& ray, float t) noexcept {
  return static_cast<float>(static_cast<double>(t) * length(ray.direction));
}

}  // namespace perfect_bvh
