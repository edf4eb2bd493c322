#include "render/filter/irradiance_accumulation.h"

namespace perfect_bvh {

void IrradianceAccumulation::begin(std::size_t pixel_count) { entries_.assign(pixel_count, Entry{}); }

void IrradianceAccumulation::add(const RayMaker& camera, std::span<const Ray> rays, std::span<const Hit> hits,
                                 std::span<const SurfacePoint> points, std::span<const LitPoint> lit_points) {
  for (std::size_t row = 0; row < points.size(); ++row) {
    const SurfacePoint& point = points[row];
    if (!lit_points[row].known) continue;
    const float depth = hits[point.ray].t;
    Entry& entry = entries_[point.ray];
    const Vec3f position = camera.from_camera(rays[point.ray], depth);
    if (entry.count == 0) {
      entry.pixel.position = position;
      entry.pixel.normal = point.light_normal;
      entry.pixel.footprint = camera.footprint(depth);
    } else if (!same_surface(entry.pixel, position, point.light_normal)) {
      continue;
    }
    ++entry.count;
    entry.pixel.light = entry.pixel.light + lit_points[row].light;
    entry.pixel.color = entry.pixel.color + lit_points[row].color;
    entry.lit = entry.lit + lit_points[row].lit;
  }
}

LightPixel IrradianceAccumulation::pixel(std::size_t index, std::uint32_t sample_count) const noexcept {
  const Entry& entry = entries_[index];
  if (entry.count == 0) return {};
  const float scale = 1.0f / static_cast<float>(entry.count);
  LightPixel pixel = entry.pixel;
  pixel.light = pixel.light * scale;
  pixel.color = pixel.color * scale;
  pixel.share = static_cast<float>(entry.count) / static_cast<float>(sample_count);
  return pixel;
}

Vec3f IrradianceAccumulation::rest(std::size_t index, const Rgba& sum) const noexcept {
  const Entry& entry = entries_[index];
  return max(Vec3f{sum.r, sum.g, sum.b} - entry.lit, Vec3f{0, 0, 0});
}

}  // namespace perfect_bvh
