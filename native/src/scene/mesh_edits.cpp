// Edits of a scene's meshes. Each checks all of its input before it changes anything.
#include <algorithm>
#include <map>
#include <string>

#include "blas/make_blas.h"
#include "blas/moved_mesh.h"
#include "core/cancel.h"
#include "core/errors.h"
#include "scene/ray_shares.h"
#include "scene/scene.h"
#include "update/mesh_shape.h"

namespace perfect_bvh {
namespace {

void check_kind(const Mesh& mesh, PrimitiveKind expected, std::int32_t mesh_id, const char* function) {
  if (mesh.kind == expected) return;
  const std::string editor = names_of(mesh.kind).editor;
  throw InvalidArgument(std::string(function) + ": mesh " + std::to_string(mesh_id) + " must have " +
                        names_of(expected).kind + ", but has " + names_of(mesh.kind).kind + "; update_" + editor +
                        " and replace_" + editor + " are for those");
}

void check_can_follow(const BuildConfig& config, std::int32_t mesh_id, const char* function) {
  if (config.builder != BuilderKind::kSpatial) return;
  throw InvalidArgument(std::string(function) + ": mesh " + std::to_string(mesh_id) +
                        " is built with spatial splits, whose trees cannot follow a motion; add it with build='auto'");
}

}  // namespace

std::int32_t Scene::add_mesh(Mesh mesh, const BuildConfig& config, Usage usage) {
  const std::lock_guard lock(edit_mutex_);
  MeshSlot slot;
  slot.config = config;
  slot.usage = usage;
  slot.edited = std::make_shared<const Mesh>(std::move(mesh));
  meshes_.emplace(next_mesh_id_, std::move(slot));
  mark_edited();
  return next_mesh_id_++;
}

template <class T>
void Scene::update_mesh(std::int32_t mesh_id, std::span<const Vec3<T>> positions, ThreadPool& pool) {
  const std::lock_guard lock(edit_mutex_);
  MeshSlot& slot = find_mesh(mesh_id, "update_mesh");
  const Mesh& before = slot.held();
  check_kind(before, PrimitiveKind::kTriangles, mesh_id, "update_mesh");
  if (!slot.spare_positions) slot.spare_positions = std::make_shared<SparePositions>();
  auto moved = move_vertices(before, positions, slot.spare_positions, pool, "update_mesh");
  slot.same_topology = slot.edited ? slot.same_topology : true;
  slot.has_deformed |= slot.same_topology;
  slot.edited = std::move(moved);
  mark_edited();
}
template void Scene::update_mesh(std::int32_t, std::span<const Vec3f>, ThreadPool&);
template void Scene::update_mesh(std::int32_t, std::span<const Vec3d>, ThreadPool&);

template <class T>
void Scene::set_mesh_motion(std::int32_t mesh_id, std::span<const Vec3<T>> positions, const StepTimes& times,
                            ThreadPool& pool) {
  constexpr const char* kName = "set_mesh_motion";
  const std::lock_guard lock(edit_mutex_);
  MeshSlot& slot = find_mesh(mesh_id, kName);
  const Mesh& before = slot.held();
  check_kind(before, PrimitiveKind::kTriangles, mesh_id, kName);
  check_can_follow(slot.config, mesh_id, kName);
  if (!slot.spare_positions) slot.spare_positions = std::make_shared<SparePositions>();
  auto moved = move_in_steps(before, positions, times, slot.spare_positions, pool, kName);
  slot.same_topology = slot.edited ? slot.same_topology : true;
  slot.has_deformed = true;  // even if it is new: its tree will be refitted to each step
  slot.edited = std::move(moved);
  mark_edited();
}
template void Scene::set_mesh_motion(std::int32_t, std::span<const Vec3f>, const StepTimes&, ThreadPool&);
template void Scene::set_mesh_motion(std::int32_t, std::span<const Vec3d>, const StepTimes&, ThreadPool&);

namespace {

// Returns the spheres of one step; the input has one step after another.
template <class T>
BallsGiven<T> balls_of_step(const BallsGiven<T>& balls, std::size_t step, std::size_t step_count) {
  const std::size_t count = balls.centres.size() / step_count, radius_count = balls.radii.size() / step_count;
  return {balls.centres.subspan(step * count, count), balls.radii.subspan(step * radius_count, radius_count)};
}

}  // namespace

template <class T>
void Scene::set_round_motion(std::int32_t mesh_id, PrimitiveKind kind, const BallsGiven<T>& balls,
                             std::span<const std::int64_t> offsets, const StepTimes& times, ThreadPool& pool) {
  const std::string name = std::string("set_") + names_of(kind).editor + "_motion";
  const char* const function = name.c_str();
  const std::lock_guard lock(edit_mutex_);
  MeshSlot& slot = find_mesh(mesh_id, function);
  check_kind(slot.held(), kind, mesh_id, function);
  check_can_follow(slot.config, mesh_id, function);
  const std::size_t step_count = times.last + std::size_t{1};
  if (!slot.spare_positions) slot.spare_positions = std::make_shared<SparePositions>();
  const BallsGiven<T> first = balls_of_step(balls, 0, step_count);
  const bool is_other = !offsets.empty() && !std::ranges::equal(slot.held().starts, offsets);
  MovedBalls moved = is_other
                         ? MovedBalls{std::make_shared<const Mesh>(make_curves(first, offsets, slot.held().shape,
                                                                               function, slot.held().cyclic_curves())),
                                      false}
                         : move_balls(slot.held(), first, slot.spare_positions, pool, function);
  const auto mesh = std::const_pointer_cast<Mesh>(moved.mesh);  // just made, not shared yet
  mesh->times = times;
  for (std::size_t step = 1; step < step_count; ++step) {
    mesh->later.push_back(balls_at_step(*mesh, balls_of_step(balls, step, step_count), pool, function));
  }
  slot.same_topology = moved.same_primitives && (slot.edited ? slot.same_topology : true);
  slot.has_deformed = true;
  slot.edited = mesh;
  mark_edited();
}
template void Scene::set_round_motion(std::int32_t, PrimitiveKind, const BallsGiven<float>&,
                                      std::span<const std::int64_t>, const StepTimes&, ThreadPool&);
template void Scene::set_round_motion(std::int32_t, PrimitiveKind, const BallsGiven<double>&,
                                      std::span<const std::int64_t>, const StepTimes&, ThreadPool&);

template <class T>
void Scene::move(MeshSlot& slot, const BallsGiven<T>& balls, ThreadPool& pool, const char* function) {
  if (!slot.spare_positions) slot.spare_positions = std::make_shared<SparePositions>();
  MovedBalls moved = move_balls(slot.held(), balls, slot.spare_positions, pool, function);
  slot.same_topology = moved.same_primitives && (slot.edited ? slot.same_topology : true);
  slot.has_deformed = slot.same_topology || (slot.has_deformed && moved.same_primitives);
  slot.edited = std::move(moved.mesh);
  mark_edited();
}

void Scene::replace(MeshSlot& slot, Mesh mesh) {
  slot.edited = std::make_shared<const Mesh>(std::move(mesh));
  slot.same_topology = slot.has_deformed = false;
  slot.spare_positions.reset();
  mark_edited();
}

template <class T>
void Scene::update_balls(std::int32_t mesh_id, PrimitiveKind kind, const BallsGiven<T>& balls, ThreadPool& pool) {
  const std::lock_guard lock(edit_mutex_);
  const std::string name = std::string("update_") + names_of(kind).editor;
  const char* const function = name.c_str();
  MeshSlot& slot = find_mesh(mesh_id, function);
  check_kind(slot.held(), kind, mesh_id, function);
  move(slot, balls, pool, function);
}
template void Scene::update_balls(std::int32_t, PrimitiveKind, const BallsGiven<float>&, ThreadPool&);
template void Scene::update_balls(std::int32_t, PrimitiveKind, const BallsGiven<double>&, ThreadPool&);

template <class T>
void Scene::set_chains(std::int32_t mesh_id, const BallsGiven<T>& balls, std::span<const std::int64_t> offsets,
                       ThreadPool& pool) {
  const std::lock_guard lock(edit_mutex_);
  const char* const function = "update_curves";
  MeshSlot& slot = find_mesh(mesh_id, function);
  check_kind(slot.held(), PrimitiveKind::kCurves, mesh_id, function);
  if (std::ranges::equal(slot.held().starts, offsets)) {
    move(slot, balls, pool, function);
  } else {
    replace(slot, make_curves(balls, offsets, slot.held().shape, function, slot.held().cyclic_curves()));
  }
}
template void Scene::set_chains(std::int32_t, const BallsGiven<float>&, std::span<const std::int64_t>, ThreadPool&);
template void Scene::set_chains(std::int32_t, const BallsGiven<double>&, std::span<const std::int64_t>, ThreadPool&);

void Scene::replace_mesh(std::int32_t mesh_id, Mesh mesh, const char* function) {
  const std::lock_guard lock(edit_mutex_);
  MeshSlot& slot = find_mesh(mesh_id, function);
  check_kind(slot.held(), mesh.kind, mesh_id, function);
  replace(slot, std::move(mesh));
}

void Scene::set_usage(std::int32_t mesh_id, Usage usage) {
  const std::lock_guard lock(edit_mutex_);
  find_mesh(mesh_id, "set_usage").usage = usage;  // answers do not depend on it: nothing becomes stale
}

void Scene::remove_mesh(std::int32_t mesh_id) {
  const std::lock_guard lock(edit_mutex_);
  const MeshSlot& slot = find_mesh(mesh_id, "remove_mesh");
  if (slot.user_count != 0) {
    throw InvalidArgument("remove_mesh: mesh " + std::to_string(mesh_id) + " is still used by " +
                          std::to_string(slot.user_count) + " instances; remove those first");
  }
  meshes_.erase(mesh_id);
  mark_edited();
}

// Changed meshes ------------------------------------------------------------------------------------------------------
// Finds the meshes for which a commit has a decision to make, and the number of rays that each may expect.

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

// Trees at rest are checked again after this many rays per instance. Finding an instance's share takes about a third of
// a ray's time (85 ns), and each frame that moves an instance is an edit.
constexpr double kRaysOfAShare = 4;

}  // namespace

// Stored at once, not when the commit succeeds, so that the caller need not repeat it after an aborted commit.
RayForecast Scene::forecast_rays(const CommitOptions& options) {
  const std::uint64_t cast_in_all = rays_cast();
  RayForecast rays{options.expected_rays, static_cast<double>(cast_in_all - cast_until_last_commit_), cast_in_all};
  if (options.expected_rays.value_or(0) > 0) told_rays_ = options.expected_rays;
  if (!options.expected_rays && told_rays_) rays.expected = std::max(*told_rays_, rays.cast);
  return rays;
}

// Returns the rays of the scene until its tree is expected to be replaced.
double Scene::most_served_rays(const MeshSlot& slot, const RayForecast& rays) const noexcept {
  return static_cast<double>(rays.cast_in_all - slot.cast_before) + rays_to_come(slot.usage, rays.likely());
}

// served: the most rays that its tree may have to serve. The empty-space ratio is measured once, when it matters.
bool Scene::may_be_replaced(MeshSlot& slot, double served, const CommitOptions& options, CancelToken& cancel) {
  if (!(served > most_rays_of_tree(slot, options))) return false;
  if (!slot.air) slot.air = measure_air(slot.blas->mesh, cancel);
  return served > most_rays_of_tree(slot, options);
}

// Shares take long to compute if there are many instances. They stay valid while nothing is edited. No share is needed
// for a mesh whose tree is the best for more rays than there are, nor for a mesh at rest before there are enough rays
// to pay off the check.
std::vector<ChangedMesh> Scene::find_changed(const CommitOptions& options, const RayForecast& rays,
                                             CancelToken& cancel) {
  std::vector<ChangedMesh> changed;
  bool needs_shares = false;
  const double rays_of_shares =
      std::max(rays.expected.value_or(0), static_cast<double>(rays.cast_in_all - cast_until_shares_));
  const bool pays = rays_of_shares >= kRaysOfAShare * static_cast<double>(instances_.size());
  for (auto& [mesh_id, slot] : meshes_) {
    const bool is_known = slot.share_of == edit_count_;
    // No box has more surface area than the scene's.
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
