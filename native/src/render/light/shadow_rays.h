// Rays towards lights, and how much of its light gets through what is in their way.
// In: rays, and what each brings if nothing is in its way. Out: how much passes; all of it, nothing, or what
// transparent surfaces let through.
#pragma once

#include <cstdint>

#include "core/aligned.h"
#include "core/cancel.h"
#include "query/trace.h"
#include "render/appearance/appearance.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// Buffers of one thread; a row a ray.
struct ShadowRays {
  AlignedVector<Ray> rays;
  AlignedVector<std::uint32_t> targets;  // the row of the point that a ray belongs to
  AlignedVector<Vec3f> carried, shine;   // light, and a highlight
  AlignedVector<float> passed;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint8_t> blocked;

  void clear() noexcept { rays.clear(), targets.clear(), carried.clear(), shine.clear(); }
  void add(const Ray& ray, std::uint32_t target, Vec3f light, Vec3f highlight) {
    rays.push_back(ray), targets.push_back(target), carried.push_back(light), shine.push_back(highlight);
  }
};

// Fills `passed`. Spoils the rays.
void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, CancelToken& cancel, ShadowRays& shadows);

}  // namespace perfect_bvh
