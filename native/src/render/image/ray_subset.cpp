#include "render/image/ray_subset.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "render/sampling/sampler.h"

namespace perfect_bvh {

RaySubset::RaySubset(float share, std::uint32_t seed) noexcept
    : limit_(static_cast<std::uint64_t>(static_cast<double>(share) * 0x1p32)),
      seed_(sampling::mix(seed ^ 0x5bd1e995u)) {}

void RaySubset::offer(const Snapshot& snapshot, std::uint32_t sample, std::span<const Pixel> pixels,
                      std::span<const Ray> rays, std::span<const Hit> hits) {
  if (limit_ == 0) return;
  std::vector<SubsetRay> chosen;
  const std::uint32_t salt = sampling::mix(seed_ + sample);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (sampling::mix(salt ^ sampling::z_order(pixels[i].x, pixels[i].y)) >= limit_) continue;
    const Hit& hit = hits[i];
    SubsetRay& kept = chosen.emplace_back();
    kept = {pixels[i], sample, rays[i], std::numeric_limits<float>::infinity(), -1, -1};
    if (!hit.found()) continue;
    kept.t = hit.t;
    kept.instance_id = snapshot.instances[hit.instance_index].id;
    kept.primitive_id = static_cast<std::int32_t>(hit.primitive_index);
  }
  const std::lock_guard lock(mutex_);
  kept_.insert(kept_.end(), chosen.begin(), chosen.end());
}

std::vector<SubsetRay> RaySubset::take() {
  const auto place = [](const SubsetRay& kept) { return std::tuple(kept.pixel.y, kept.pixel.x, kept.sample); };
  std::sort(kept_.begin(), kept_.end(), [&](const SubsetRay& a, const SubsetRay& b) { return place(a) < place(b); });
  return std::move(kept_);
}

}  // namespace perfect_bvh
