// Which meshes a commit has anything to decide about, and how many rays each may expect.

#include <algorithm>
#include <map>

#include "blas/choose_tree.h"
#include "blas/make_blas.h"
#include "core/steps.h"
#include "scene/ray_shares.h"
#include "scene/scene.h"
#include "update/mesh_shape.h"

namespace perfect_bvh {
namespace {

Aabb bounds_of(const Mesh& mesh, CancelToken& cancel) {
  Aabb box;
  for_steps(mesh.balls.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) box.grow(box_of(mesh.balls[i]));
  });
  for_steps(mesh.positions.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) box.grow(mesh.positions[i]);
  });
  return box;
}

// Trees at rest are asked about again after so many rays an instance: finding an instance's share takes about a third
// of a ray's time (85 ns), and each frame that moves one is an edit.
constexpr double kRaysOfAShare = 4;

}  // namespace

// At once, and not when the commit succeeds: whoever repeats one that was stopped need not tell it again.
RayForecast Scene::forecast_rays(const CommitOptions& options) {
  const std::uint64_t cast_in_all = rays_cast();
  RayForecast rays{options.expected_rays, static_cast<double>(cast_in_all - cast_until_last_commit_), cast_in_all};
  if (options.expected_rays.value_or(0) > 0) told_rays_ = options.expected_rays;
  if (!options.expected_rays && told_rays_) rays.expected = std::max(*told_rays_, rays.cast);
  return rays;
}

// Of the scene's rays, by the time that its tree is expected to be replaced.
double Scene::most_served_rays(const MeshSlot& slot, const RayForecast& rays) const noexcept {
  return static_cast<double>(rays.cast_in_all - slot.cast_before) + rays_to_come(slot.usage, rays.likely());
}

// served: most rays that its tree may have to serve. Air is measured where it matters, once.
bool Scene::may_be_replaced(MeshSlot& slot, double served, const CommitOptions& options, CancelToken& cancel) {
  if (!(served > most_rays_of_tree(slot, options))) return false;
  if (!slot.air) slot.air = measure_air(slot.blas->mesh, cancel);
  return served > most_rays_of_tree(slot, options);
}

// Shares are what takes long, with many instances. They stay while nothing is edited, and a mesh whose tree is the best
// for more rays than there are needs none; nor does one at rest before rays pay for the asking.
std::vector<ChangedMesh> Scene::find_changed(const CommitOptions& options, const RayForecast& rays,
                                             CancelToken& cancel) {
  std::vector<ChangedMesh> changed;
  bool needs_shares = false;
  const double rays_of_shares =
      std::max(rays.expected.value_or(0), static_cast<double>(rays.cast_in_all - cast_until_shares_));
  const bool pays = rays_of_shares >= kRaysOfAShare * static_cast<double>(instances_.size());
  for (auto& [mesh_id, slot] : meshes_) {
    const bool is_known = slot.share_of == edit_count_;
    // No box has more surface than the scene's.
    const double most = (is_known ? slot.ray_share : slot.user_count) * most_served_rays(slot, rays);
    const bool is_asked_about = rays.likely() > 0 && (is_known || pays);
    if (!needs_decision(slot, options) && !(is_asked_about && may_be_replaced(slot, most, options, cancel))) continue;
    changed.push_back({mesh_id, &slot, std::nullopt});
    needs_shares |= !is_known;
  }
  if (!(rays.expected || rays.cast > 0) || changed.empty()) return changed;
  if (needs_shares) {
    find_ray_shares(changed, cancel);
    cast_until_shares_ = rays.cast_in_all;
  }
  for (ChangedMesh& mesh : changed) {
    const auto& slot = static_cast<const MeshSlot&>(*mesh.state);
    if (rays.expected) mesh.rays = *rays.expected * slot.ray_share;
    mesh.cast_rays = rays.cast * slot.ray_share;
    if (is_resting(slot)) mesh.served_rays = static_cast<double>(rays.cast_in_all - slot.cast_before) * slot.ray_share;
  }
  std::erase_if(changed, [&](const ChangedMesh& mesh) {
    const auto& slot = static_cast<const MeshSlot&>(*mesh.state);
    return !needs_decision(slot, options) &&
           !(slot.ray_share * most_served_rays(slot, rays) > most_rays_of_tree(slot, options));
  });
  return changed;
}

void Scene::find_ray_shares(std::span<const ChangedMesh> meshes, CancelToken& cancel) {
  struct Place {
    Aabb box;
    Vec3d centre;
    std::size_t row = RayShares::kOther;
  };
  std::map<std::int32_t, Place> places;  // by mesh id
  Steps steps(cancel);
  for (const auto& [mesh_id, slot] : meshes_) {
    steps.step();
    const Aabb box = slot.edited ? bounds_of(*slot.edited, cancel) : slot.blas->box;
    const Vec3d centre = slot.edited ? slot.edited->centre : slot.blas->mesh.centre;
    places[mesh_id] = {box, centre};
  }
  for (std::size_t row = 0; row < meshes.size(); ++row) places[meshes[row].mesh_id].row = row;
  RayShares shares(meshes.size());
  auto found = places.end();
  for (const Placement& slot : instances_) {
    steps.step();
    if (found == places.end() || found->first != slot.mesh_id) found = places.find(slot.mesh_id);
    Affine map = slot.object_to_world;
    map.translation = map.point(found->second.centre);
    shares.add(found->second.box, map, found->second.row);
  }
  for (std::size_t row = 0; row < meshes.size(); ++row) {
    MeshSlot& slot = meshes_.find(meshes[row].mesh_id)->second;
    slot.ray_share = shares.of(row);
    slot.share_of = edit_count_;
  }
}

}  // namespace perfect_bvh
