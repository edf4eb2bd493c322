#include "our_rays.h"

#include <algorithm>
#include <utility>

#include "query/trace.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::bench {

OurRays::OurRays(std::shared_ptr<const Snapshot> scene, std::string isa, TraceOptions options)
    : scene_(std::move(scene)), isa_(std::move(isa)), options_(options) {}

void OurRays::load(std::span<const Ray> rays, RayUse use) {
  set_active_kernels(isa_);
  use_ = use;
  rays_.assign(rays.begin(), rays.end());
  if (use.is_any_hit) {
    occluded_.assign(rays.size(), 0);
  } else {
    hits_.assign(rays.size(), Hit{});
  }
}

void OurRays::cast() {
  if (use_.is_any_hit) {
    trace_any(scene_->view, {rays_.data(), rays_.size(), Cull::kNone, nullptr, nullptr, occluded_.data()}, options_);
  } else {
    trace_closest(scene_->view, {rays_.data(), rays_.size(), Cull::kNone, nullptr, hits_.data(), nullptr}, options_);
  }
}

void OurRays::read(std::span<Hit> hits) const { std::copy_n(hits_.begin(), hits.size(), hits.begin()); }

void OurRays::read(std::span<std::uint8_t> occluded) const {
  std::copy_n(occluded_.begin(), occluded.size(), occluded.begin());
}

Visits count_visits(const Snapshot& scene, const RaySet& set) {
  std::vector<RayCounts> counts(set.rays.size());
  if (set.use.is_any_hit) {
    std::vector<std::uint8_t> occluded(set.rays.size());
    trace_occluded(scene, set.rays, occluded, Cull::kNone, counts);
  } else {
    std::vector<Hit> hits(set.rays.size());
    trace_closest(scene, set.rays, hits, Cull::kNone, counts);
  }
  Visits sum;
  for (const RayCounts& each : counts) sum.nodes += each.nodes_visited, sum.triangles += each.primitives_tested;
  const auto ray_count = static_cast<double>(set.rays.size());
  return {sum.nodes / ray_count, sum.triangles / ray_count};
}

}  // namespace perfect_bvh::bench
