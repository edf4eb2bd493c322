#include "render/light/emissive_triangles.h"

#include <algorithm>
#include <cmath>

#include "query/trace.h"
#include "render/surface/material.h"

namespace perfect_bvh {
namespace {

// What emits less is left to rays that are spread by the surface: it makes no specks, and a ray to it costs as much as
// one to a lamp.
constexpr float kLeastBrightness = 10.0f;
constexpr std::size_t kMostTriangles = std::size_t{1} << 18;

Hit hit_on(std::uint32_t instance, std::uint32_t primitive) noexcept {
  Hit hit;
  hit.instance_index = instance, hit.primitive_index = primitive;
  return hit;
}

// While it moves: what has no area at first may shine later.
double largest_area(const Instance& instance, TriangleIndices corners) noexcept {
  const auto area = [&](float time) { return 0.5 * length(place_triangle(instance, corners, time).scaled_normal()); };
  if (instance.motion == 0) return area(0.0f);
  double largest = 0.0;
  constexpr int kTimes = 8;
  for (int i = 0; i <= kTimes; ++i) largest = std::max(largest, area(static_cast<float>(i) / kTimes));
  return largest;
}

}  // namespace

EmissiveTriangles::EmissiveTriangles(const Snapshot& snapshot, const Appearance& appearance)
    : snapshot_(snapshot), appearance_(appearance) {
  const auto glows = [](Vec3f color) { return std::max({color.x, color.y, color.z}) >= kLeastBrightness; };
  if (!std::any_of(appearance.emissions.begin(), appearance.emissions.end(), glows)) return;
  for (std::uint32_t i = 0; i < snapshot.instances.size(); ++i) {
    if (may_emit(snapshot.instances[i]) && !list(i)) {
      triangles_.clear(), powers_.clear();
      return;
    }
  }
}

float EmissiveTriangles::brightness(std::int32_t material) const noexcept {
  const auto row = static_cast<std::size_t>(material);
  const Vec3f color = appearance_.emissions[row];
  const float alpha = appearance_.alphas.empty() ? 1.0f : appearance_.alphas[row];
  const float bright = std::max({color.x, color.y, color.z}) * alpha;
  return bright >= kLeastBrightness ? bright : 0.0f;
}

bool EmissiveTriangles::may_emit(const Instance& instance) const noexcept {
  if (instance.blas->mesh.is_round()) return false;  // rays find their light by hitting them
  const std::int32_t row = appearance_.row_of(instance);
  if (row < 0 || (instance.mask & appearance_.diffuse_mask) == 0) return false;
  const auto index = static_cast<std::size_t>(row);
  const auto slots = appearance_.slot_materials.subspan(
      static_cast<std::size_t>(appearance_.slot_offsets[index]),
      static_cast<std::size_t>(appearance_.slot_offsets[index + 1] - appearance_.slot_offsets[index]));
  return std::any_of(slots.begin(), slots.end(),
                     [&](std::int32_t material) { return material != kNoMaterial && brightness(material) > 0.0f; });
}

bool EmissiveTriangles::list(std::uint32_t instance_index) {
  const Instance& instance = snapshot_.instances[instance_index];
  const auto count = static_cast<std::uint32_t>(instance.blas->mesh.primitive_count());
  for (std::uint32_t primitive = 0; primitive < count; ++primitive) {
    const std::int32_t material = appearance_.material_of(instance, primitive);
    if (material == kNoMaterial || !(brightness(material) > 0.0f)) continue;
    const double area = largest_area(instance, instance.blas->mesh.triangles[primitive]);
    const double power = area * static_cast<double>(brightness(material));
    if (!(power > 0.0) || !std::isfinite(power)) continue;
    if (triangles_.size() == kMostTriangles) return false;
    powers_.push_back((powers_.empty() ? 0.0 : powers_.back()) + power);
    triangles_.push_back({instance_index, primitive, static_cast<float>(area)});
  }
  return true;
}

// Where a triangle is smaller than it is listed it is chosen too often, and its light is less by that.
EmissivePoint EmissiveTriangles::choose(float pick, Point2 place, float time) const {
  const auto found = std::upper_bound(powers_.begin(), powers_.end() - 1, static_cast<double>(pick) * power());
  const Triangle& triangle = triangles_[static_cast<std::size_t>(found - powers_.begin())];
  Hit hit = hit_on(triangle.instance, triangle.primitive);
  // Even over the triangle.
  const float rest = std::sqrt(place.x);
  hit.u = 1.0f - rest, hit.v = place.y * rest;
  const Instance& instance = snapshot_.instances[triangle.instance];
  const std::int32_t row = appearance_.material_of(instance, triangle.primitive);
  const Material material = material_at(appearance_, instance, hit, row);
  const Vec3d normal = world_triangle(snapshot_, hit, time).scaled_normal();
  const float growth = instance.motion == 0 ? 1.0f : static_cast<float>(0.5 * length(normal)) / triangle.area;
  return {hit_position(snapshot_, hit, time), to_float(normalized(normal)),
          material.emission * (material.alpha * growth), density(instance, row), instance.mask};
}

}  // namespace perfect_bvh
