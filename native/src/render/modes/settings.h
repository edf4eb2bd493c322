// What to render and how: plain values, filled by the caller.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "math/vec3.h"
#include "render/light/path.h"
#include "render/sampling/shutter.h"
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

}  // namespace perfect_bvh
