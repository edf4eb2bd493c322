#include "our_instances.h"

#include <numeric>

#include "our_rays.h"

namespace perfect_bvh::bench {

OurInstances::OurInstances(const Mesh& mesh, int thread_count) : pool_(thread_count) {
  mesh_id_ = scene_.add_mesh(mesh, BuildConfig{}, Usage::kStatic);
  commit();
}

void OurInstances::prepare(std::span<const Affine> transforms) {
  transforms_.assign(transforms.begin(), transforms.end());
  if (!ids_.empty()) return;
  inputs_.clear();
  for (const Affine& map : transforms) inputs_.push_back({mesh_id_, map, 0xFFFFFFFFu, std::nullopt});
}

void OurInstances::add() {
  const std::int32_t first = scene_.add_instances(inputs_);
  ids_.resize(inputs_.size());
  std::iota(ids_.begin(), ids_.end(), first);
}

void OurInstances::move() { scene_.set_transforms(ids_, transforms_); }

void OurInstances::commit() {
  CancelToken cancel;
  report_ = scene_.commit(pool_, cancel);
}

std::shared_ptr<RayCaster> OurInstances::caster() const { return std::make_shared<OurRays>(snapshot()); }

}  // namespace perfect_bvh::bench
