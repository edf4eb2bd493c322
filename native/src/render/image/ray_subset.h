// A random share of an image's camera rays, with what each hit: for checks of the renderer's answers.
// In: batches of rays and hits, from any thread. Out: those whose lot it was, in the order of pixels and samples. Which
// rays that are follows from seed, pixel and sample alone, so that it does not depend on tiles or threads.
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "render/sampling/camera.h"
#include "tlas/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

struct SubsetRay {
  Pixel pixel;
  std::uint32_t sample;
  Ray ray;
  float t;  // infinite on a miss
  std::int32_t instance_id, primitive_id;
};

class RaySubset {
 public:
  // share: 0 to 1 of all rays.
  RaySubset(float share, std::uint32_t seed) noexcept;

  // One sample of some pixels: ray i and hit i belong to pixel i.
  void offer(const Snapshot& snapshot, std::uint32_t sample, std::span<const Pixel> pixels, std::span<const Ray> rays,
             std::span<const Hit> hits);
  [[nodiscard]] std::vector<SubsetRay> take();

 private:
  std::uint64_t limit_;  // of 2^32 lots
  std::uint32_t seed_;
  std::vector<SubsetRay> kept_;
  std::mutex mutex_;
};

}  // namespace perfect_bvh
