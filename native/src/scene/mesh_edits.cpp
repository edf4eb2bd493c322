// Edits of a scene's meshes. Each checks all of its input before it changes anything.

#include <algorithm>

#include "blas/moved_balls.h"
#include "core/errors.h"
#include "scene/scene.h"

namespace perfect_bvh {
namespace {

const char* update_of(PrimitiveKind kind) noexcept {
  if (kind == PrimitiveKind::kTriangles) return "update_mesh and replace_mesh are";
  return kind == PrimitiveKind::kCurves ? "update_curves and replace_curves are"
                                        : "update_points and replace_points are";
}

void check_kind(const Mesh& mesh, PrimitiveKind expected, std::int32_t mesh_id, const char* function) {
  if (mesh.kind == expected) return;
  throw InvalidArgument(std::string(function) + ": mesh " + std::to_string(mesh_id) + " must have " +
                        kind_name(expected) + ", but has " + kind_name(mesh.kind) + "; " + update_of(mesh.kind) +
                        " for those");
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
  slot.has_deformed = true;  // also if it is new: its tree will be refitted to each step
  slot.edited = std::move(moved);
  mark_edited();
}
template void Scene::set_mesh_motion(std::int32_t, std::span<const Vec3f>, const StepTimes&, ThreadPool&);
template void Scene::set_mesh_motion(std::int32_t, std::span<const Vec3d>, const StepTimes&, ThreadPool&);

namespace {

// Of what is given one step after another.
template <class T>
BallsGiven<T> balls_of_step(const BallsGiven<T>& balls, std::size_t step, std::size_t step_count) {
  const std::size_t count = balls.centres.size() / step_count, radius_count = balls.radii.size() / step_count;
  return {balls.centres.subspan(step * count, count), balls.radii.subspan(step * radius_count, radius_count)};
}

}  // namespace

template <class T>
void Scene::set_round_motion(std::int32_t mesh_id, PrimitiveKind kind, const BallsGiven<T>& balls,
                             std::span<const std::int64_t> offsets, const StepTimes& times, ThreadPool& pool) {
  const char* const function = kind == PrimitiveKind::kPoints ? "set_points_motion" : "set_curves_motion";
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
  const auto mesh = std::const_pointer_cast<Mesh>(moved.mesh);  // just made: nobody else has it
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
  const char* const function = kind == PrimitiveKind::kPoints ? "update_points" : "update_curves";
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
  find_mesh(mesh_id, "set_usage").usage = usage;  // no answer changes by it: nothing is stale
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

}  // namespace perfect_bvh
