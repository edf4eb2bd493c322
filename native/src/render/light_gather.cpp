#include "render/light_gather.h"

namespace perfect_bvh {

void LightGather::begin(std::size_t pixel_count) { entries_.assign(pixel_count, Entry{}); }

void LightGather::add(const RayMaker& camera, std::span<const Ray> rays, std::span<const Hit> hits,
                      std::span<const SurfacePoint> points, std::span<const LightSample> lights) {
  for (std::size_t row = 0; row < points.size(); ++row) {
    const SurfacePoint& point = points[row];
    const float depth = hits[point.ray].t;
    Entry& entry = entries_[point.ray];
    const Vec3f position = camera.from_camera(rays[point.ray], depth);
    if (entry.count == 0) {
      entry.pixel.position = position;
      entry.pixel.normal = point.light_normal;
      entry.pixel.footprint = camera.footprint(depth);
    } else if (!same_surface(entry.pixel, position, point.light_normal)) {
      continue;  // the count then falls short
    }
    ++entry.count;
    entry.pixel.light = entry.pixel.light + lights[row];
    entry.color = entry.color + point.color;
  }
}

LightPixel LightGather::pixel(std::size_t index, std::uint32_t sample_count) const noexcept {
  const Entry& entry = entries_[index];
  if (entry.count != sample_count) return {};
  LightPixel pixel = entry.pixel;
  pixel.light = pixel.light * (1.0f / static_cast<float>(sample_count));
  return pixel;
}

Vec3f LightGather::color(std::size_t index, std::uint32_t sample_count) const noexcept {
  return entries_[index].color * (1.0f / static_cast<float>(sample_count));
}

}  // namespace perfect_bvh
