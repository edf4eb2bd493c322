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
  AlignedVector<std::uint32_t> vertices;  // the row of the vertex that a ray belongs to
  AlignedVector<Vec3f> carried;           // what it adds to the image if nothing is in its way
  AlignedVector<float> passed;
  AlignedVector<Hit> hits;
  AlignedVector<std::uint8_t> blocked;

  void clear() noexcept { rays.clear(), vertices.clear(), carried.clear(); }
  void add(const Ray& ray, std::uint32_t vertex, Vec3f light) {
    rays.push_back(ray), vertices.push_back(vertex), carried.push_back(light);
  }
};

// Fills `passed`. Spoils the rays.
// most_layers: of transparent surfaces that a ray passes; what is behind them is dark.
void find_what_passes(const Snapshot& snapshot, const Appearance& appearance, int most_layers, CancelToken& cancel,
                      ShadowRays& shadows);

}  // namespace perfect_bvh
