#include "render/light/secondary_rays.h"

#include <algorithm>
#include <cmath>

#include "render/surface/material.h"

namespace perfect_bvh {
namespace {

// Surface after surface takes its share, until nothing is left or nothing is in the way.
void pass_layers(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                 ShadowRays& shadows) {
  for (int layer = 0; layer <= most_layers; ++layer) {
    shadows.hits.resize(shadows.rays.size());
    trace_closest(snapshot, cancel, shadows.rays, shadows.hits);
    bool goes_on = false;
    for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
      const Hit& hit = shadows.hits[i];
      Ray& ray = shadows.rays[i];
      if (!hit.found()) {
        ray.t_min = 1.0f, ray.t_max = 0.0f;  // done: such a ray hits nothing
        continue;
      }
      const Instance& instance = snapshot.instances[hit.instance_index];
      const std::int32_t material = appearance.material_of(instance, hit.primitive_index);
      const float passes = layer == most_layers ? 0.0f : material_at(appearance, instance, hit, material).through();
      shadows.passed[i] *= std::max(passes, 0.0f);
      ray.t_min = std::nextafter(hit.t, kInfiniteDistance);
      if (!(shadows.passed[i] > 0.0f)) ray.t_max = -1.0f;
      goes_on = true;
    }
    if (!goes_on) return;
  }
}

}  // namespace

void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                      ShadowRays& shadows) {
  shadows.passed.assign(shadows.rays.size(), 1.0f);
  if (appearance.any_transparent()) return pass_layers(snapshot, appearance, most_layers, cancel, shadows);
  shadows.blocked.resize(shadows.rays.size());
  trace_occluded(snapshot, cancel, shadows.rays, shadows.blocked);
  for (std::size_t i = 0; i < shadows.rays.size(); ++i) {
    if (shadows.blocked[i] != 0) shadows.passed[i] = 0.0f;
  }
}

}  // namespace perfect_bvh
