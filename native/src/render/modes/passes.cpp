#include "render/modes/passes.h"

namespace perfect_bvh {
namespace {

void store_surface(const PassTargets& targets, const Snapshot& snapshot, const Appearance& appearance,
                   std::size_t pixel, const SurfacePoint& point, const Ray& ray, const Hit& hit) {
  const Instance& instance = snapshot.instances[hit.instance_index];
  if (!targets.depth.empty()) targets.depth[pixel] = hit.t;  // rays advance by one along the view axis
  if (!targets.distance.empty()) targets.distance[pixel] = distance_of(ray, hit.t);
  if (!targets.normal.empty()) targets.normal[pixel] = point.normal;
  if (!targets.instance.empty()) targets.instance[pixel] = instance.id;
  if (!targets.primitive.empty()) targets.primitive[pixel] = static_cast<std::int32_t>(hit.primitive_index);
  if (!targets.object_index.empty()) {
    const auto row = appearance.row_of(instance);
    if (row >= 0) targets.object_index[pixel] = appearance.object_pass_indices[static_cast<std::size_t>(row)];
  }
  if (!targets.material_index.empty()) {
    const auto material = appearance.material_of(instance, hit.primitive_index);
    if (material >= 0) {
      targets.material_index[pixel] = appearance.material_pass_indices[static_cast<std::size_t>(material)];
    }
  }
}

// As if nothing was hit.
void clear(const PassTargets& targets, std::size_t pixel) {
  const auto set = [pixel](auto target, auto value) {
    if (!target.empty()) target[pixel] = value;
  };
  set(targets.depth, kNoDepth);
  set(targets.distance, kNoDepth);
  set(targets.normal, Vec3f{0, 0, 0});
  set(targets.object_index, 0);
  set(targets.material_index, 0);
  set(targets.instance, -1);
  set(targets.primitive, -1);
}

void store_counts(const PassTargets& targets, std::size_t pixel, const RayCounts& counts) {
  const auto set = [pixel](std::span<std::int32_t> target, std::uint32_t value) {
    if (!target.empty()) target[pixel] = static_cast<std::int32_t>(value);
  };
  set(targets.nodes_visited, counts.nodes_visited);
  set(targets.primitives_tested, counts.primitives_tested);
}

}  // namespace

void store_passes(const PassTargets& targets, const Snapshot& snapshot, const Appearance& appearance,
                  const PixelRect& border, int image_width, const CentreHits& found) {
  const auto row_of = [image_width](Pixel pixel) {
    return static_cast<std::size_t>(pixel.y) * static_cast<std::size_t>(image_width) + pixel.x;
  };
  const auto inside = [&](Pixel pixel) { return border.contains(pixel.x, pixel.y); };
  for (std::size_t i = 0; i < found.pixels.size(); ++i) {
    if (!inside(found.pixels[i])) continue;
    clear(targets, row_of(found.pixels[i]));
    if (targets.any_counts()) store_counts(targets, row_of(found.pixels[i]), found.counts[i]);
  }
  if (!targets.any_surface()) return;
  for (const SurfacePoint& point : found.points) {
    const Pixel pixel = found.pixels[point.ray];
    if (!inside(pixel)) continue;
    store_surface(targets, snapshot, appearance, row_of(pixel), point, found.rays[point.ray], found.hits[point.ray]);
  }
}

}  // namespace perfect_bvh
