#include "render/modes/passes.h"

#include <cmath>
#include <optional>
#include <vector>

#include "query/round_surface.h"
#include "query/trace.h"
#include "render/surface/surface.h"

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

// The motion of pixels' surfaces: their positions when the shutter opens, in its middle and when it closes.
class PixelMotions {
 public:
  explicit PixelMotions(const ShutterRays& shutter)
      : before_(shutter.camera_at(0.0f)), here_(shutter.camera_at(shutter.middle())), after_(shutter.camera_at(1.0f)) {}

  [[nodiscard]] PixelMotion of(const Instance& instance, const Hit& hit, const Ray& ray) const {
    const Vec3d point = ray.origin + ray.direction * static_cast<double>(hit.t);
    const auto at = [&](float time) { return moved_position(instance, hit, ray.time, time, point); };
    const ImagePoint here = here_.place_of(point);
    const auto [x, y] = way(before_.place_of(at(0.0f)), here);
    const auto [next_x, next_y] = way(here, after_.place_of(at(1.0f)));
    return {-x, y, -next_x, next_y};
  }

 private:
  // A point behind the camera at one of both times has no image position.
  [[nodiscard]] Point2 way(const ImagePoint& from, const ImagePoint& to) const noexcept {
    double x = to.x - from.x;
    if (const auto round = here_.round_trip()) x -= *round * std::round(x / *round);
    const bool is_seen = here_.orthographic() || (from.depth > 0.0 && to.depth > 0.0);
    return is_seen ? Point2{static_cast<float>(x), static_cast<float>(to.y - from.y)} : Point2{0.0f, 0.0f};
  }

  RayMaker before_, here_, after_;
};

// Sets the values for no hit.
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
  set(targets.vector, PixelMotion{0, 0, 0, 0});
}

void store_counts(const PassTargets& targets, std::size_t pixel, const RayCounts& counts) {
  const auto set = [pixel](std::span<std::int32_t> target, std::uint32_t value) {
    if (!target.empty()) target[pixel] = static_cast<std::int32_t>(value);
  };
  set(targets.nodes_visited, counts.nodes_visited);
  set(targets.primitives_tested, counts.primitives_tested);
}

// Returns whether passes look through this surface. Holdouts are not looked through.
bool is_passed(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit) {
  if (!hit.found()) return false;
  const Instance& instance = snapshot.instances[hit.instance_index];
  if (appearance.is_holdout(instance, hit.primitive_index)) return false;
  const std::int32_t material = appearance.material_of(instance, hit.primitive_index);
  return alpha_at(snapshot, appearance, ray, hit, material) < appearance.pass_alpha_threshold;
}

}  // namespace

void look_through(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                  std::span<Ray> rays, std::span<Hit> hits) {
  std::vector<std::size_t> rows;
  AlignedVector<Ray> rest;
  AlignedVector<Hit> behind;
  for (int layers = 0;; ++layers) {
    rows.clear(), rest.clear();
    for (std::size_t row = 0; row < hits.size(); ++row) {
      if (!is_passed(snapshot, appearance, rays[row], hits[row])) continue;
      rays[row].t_min = std::nextafter(hits[row].t, kInfiniteDistance);
      rows.push_back(row), rest.push_back(rays[row]);
    }
    if (rows.empty()) return;
    behind.assign(rows.size(), Hit{});
    if (layers < most_layers) trace_closest(snapshot, cancel, rest, behind);
    for (std::size_t i = 0; i < rows.size(); ++i) hits[rows[i]] = behind[i];
  }
}

void store_passes(const PassTargets& targets, const Snapshot& snapshot, const Appearance& appearance,
                  const ShutterRays& shutter, const PixelRect& border, int image_width, const CentreHits& found) {
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
  std::optional<PixelMotions> motions;
  if (!targets.vector.empty() && shutter.is_open()) motions.emplace(shutter);
  for (const SurfacePoint& point : found.points) {
    const Pixel pixel = found.pixels[point.ray];
    if (!inside(pixel)) continue;
    const Ray& ray = found.rays[point.ray];
    const Hit& hit = found.hits[point.ray];
    store_surface(targets, snapshot, appearance, row_of(pixel), point, ray, hit);
    if (motions) targets.vector[row_of(pixel)] = motions->of(snapshot.instances[hit.instance_index], hit, ray);
  }
}

}  // namespace perfect_bvh
