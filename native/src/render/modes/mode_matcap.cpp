// Form at one glance: light that follows from the normal as the viewer sees it and from nothing else, as if every
// surface were a piece of one ball that was photographed in a studio. A soft key light from the upper left, a cool fill
// from the right, a bright rim and a highlight, worked out instead of looked up in a picture. No shadows, no further
// rays: it costs what the normal costs.

#include "math/elementary.h"
#include "render/light/studio.h"
#include "render/modes/shading.h"

namespace perfect_bvh {
namespace {

// In the viewer's frame: x to the right, y upwards, z towards the viewer. Unit length.
constexpr Vec3f kKeyDirection{-0.48f, 0.60f, 0.64f};
constexpr Vec3f kFillDirection{0.80f, -0.12f, 0.588f};
constexpr Vec3f kHalfway{-0.265f, 0.331f, 0.906f};  // between the key light and the viewer
constexpr Vec3f kAmbient{0.16f, 0.165f, 0.18f}, kKey{0.86f, 0.83f, 0.78f}, kFill{0.10f, 0.13f, 0.18f};
constexpr Vec3f kRim{0.20f, 0.22f, 0.25f}, kHighlight{0.30f, 0.295f, 0.285f};

Vec3f light_on(Vec3f normal, Vec3f color) noexcept {
  const float wrapped = 0.5f + 0.5f * dot(normal, kKeyDirection);  // reaches round to the far side
  const float fill = std::max(dot(normal, kFillDirection), 0.0f);
  const float edge = 1.0f - std::clamp(normal.z, 0.0f, 1.0f), shine = std::max(dot(normal, kHalfway), 0.0f);
  const Vec3f diffuse = color * (kAmbient + kKey * (wrapped * wrapped) + kFill * fill);
  return diffuse + kRim * (edge * edge * edge) + kHighlight * power(shine, 48.0f);
}

class MatcapMode final : public ShadingMode {
 public:
  explicit MatcapMode(const ModeInputs& inputs) : camera_(inputs.camera), color_(inputs.settings.clay.color) {}

  [[nodiscard]] SurfaceNeeds needs() const noexcept override { return {.normals = true, .materials = !color_}; }
  [[nodiscard]] bool has_backdrop() const noexcept override { return true; }
  [[nodiscard]] Vec3f backdrop(const Ray& /*ray*/, float x, float y) const override { return Studio::backdrop(x, y); }

  void shade(const ShadeTask& task) const override {
    for (const SurfacePoint& point : task.points) {
      const Vec3f color = light_on(as_seen(point.light_normal, task.rays[point.ray]), color_.value_or(point.color));
      task.colors[point.ray] = {color.x, color.y, color.z, 1.0f};
    }
  }

 private:
  // A normal in the frame of the ray that sees it, so that a ball looks the same wherever it is in the image.
  [[nodiscard]] Vec3f as_seen(Vec3f normal, const Ray& ray) const noexcept {
    const Vec3d towards = -normalized(ray.direction);
    Vec3d right = cross(camera_.up(), towards);
    right = length(right) > 1e-9 ? normalized(right) : camera_.right();  // a panorama looks straight up, too
    const Vec3d n = to_double(normal);
    return to_float(Vec3d{dot(n, right), dot(n, cross(towards, right)), dot(n, towards)});
  }

  const RayMaker& camera_;
  std::optional<Vec3f> color_;
};

}  // namespace

std::unique_ptr<ShadingMode> make_matcap_mode(const ModeInputs& inputs) { return std::make_unique<MatcapMode>(inputs); }

}  // namespace perfect_bvh
