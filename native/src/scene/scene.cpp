#include "scene/scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/errors.h"
#include "math/vec3.h"

namespace perfect_bvh {
namespace {

[[noreturn]] void unknown_id(const char* function, const char* kind, std::int32_t id) {
  throw InvalidArgument(std::string(function) + ": there is no " + kind + " with id " + std::to_string(id) +
                        "; ids come from add_" + kind + " and end with remove_" + kind);
}

void check_same_length(std::size_t ids, std::size_t values, const char* function, const char* name) {
  if (ids == values) return;
  throw InvalidArgument(std::string(function) + ": ids has " + std::to_string(ids) + " rows but " + name + " has " +
                        std::to_string(values));
}

// Beyond this, products with positions (which are below 1e18, too) would leave the range of float.
constexpr double kLargestEntry = 1e18;

bool are_consecutive(std::span<const std::int32_t> ids) noexcept {
  std::uint32_t wrong = 0;  // no branch: several at once
  const auto first = static_cast<std::uint32_t>(ids.front());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    wrong |= static_cast<std::uint32_t>(ids[i]) ^ (first + static_cast<std::uint32_t>(i));
  }
  return wrong == 0;
}

bool is_sound(const Affine& transform) {
  bool sound = true;  // false for NaN
  for (const Vec3d v : {transform.x, transform.y, transform.z, transform.translation}) {
    for_each_axis([&](auto axis) { sound &= std::abs(v[axis]) <= kLargestEntry; });
  }
  return sound;
}

void check_transform(const Affine& transform, std::size_t row, const char* function) {
  if (is_sound(transform)) return;
  for (const Vec3d v : {transform.x, transform.y, transform.z, transform.translation}) {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(v[axis]) <= kLargestEntry) continue;
      char got[32];
      std::snprintf(got, sizeof(got), "%g", v[axis]);
      throw InvalidArgument(std::string(function) + ": transforms[" + std::to_string(row) +
                            "] must be finite and at most 1e18 in magnitude, got " + got);
    }
  }
}

void place_still(Placement& slot, const Affine& object_to_world) {
  slot.object_to_world = object_to_world;
  if (slot.turns) slot.turns.reset();
}

// Makes the motion of the i-th of `count` instances.
template <class T>
std::shared_ptr<const Turns> make_turns(Matrices<T> matrices, std::size_t i, std::size_t count,
                                        const StepTimes& times) {
  auto turns = std::make_shared<Turns>();
  turns->times = times;
  turns->steps.reserve(times.last + std::size_t{1});
  for (std::size_t step = 0; step <= times.last; ++step) {
    if (turns->add(matrices[step * count + i])) continue;
    throw InvalidArgument("set_instance_motion: transforms[" + std::to_string(step) + ", " + std::to_string(i) +
                          "] flattens the instance, which has no rotation then; scale it a little instead, or place it "
                          "with set_transforms");
  }
  turns->finish();
  return turns;
}

}  // namespace

std::uint64_t Scene::next_id() noexcept {
  static std::atomic<std::uint64_t> next{0};
  return next.fetch_add(1, std::memory_order_relaxed);
}

Scene::MeshSlot& Scene::find_mesh(std::int32_t mesh_id, const char* function) {
  const auto found = meshes_.find(mesh_id);
  if (found == meshes_.end()) unknown_id(function, "mesh", mesh_id);
  return found->second;
}

Scene::InstanceRows Scene::find_instances(std::span<const std::int32_t> ids, const char* function) const {
  const auto row_of = [&](std::int32_t id) {
    const auto found = std::lower_bound(instances_.begin(), instances_.end(), id,
                                        [](const Placement& slot, std::int32_t other) { return slot.id < other; });
    if (found == instances_.end() || found->id != id) unknown_id(function, "instance", id);
    return static_cast<std::size_t>(found - instances_.begin());
  };
  InstanceRows found;
  found.count = ids.size();
  if (ids.empty()) return found;
  found.first = row_of(ids.front());
  // Rows are ordered by id. If the ids are consecutive and the last one is as many rows away, all rows between match.
  const std::size_t last = found.first + ids.size() - 1;
  if (are_consecutive(ids) && last < instances_.size() && instances_[last].id == ids.back()) return found;
  found.rows.resize(ids.size());
  std::size_t next = found.first;  // ids are usually in the order of the rows
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (next == instances_.size() || instances_[next].id != ids[i]) next = row_of(ids[i]);
    found.is_ascending &= i == 0 || next > found.rows[i - 1];
    found.rows[i] = next++;
  }
  return found;
}

void Scene::mark_edited() {
  const std::lock_guard lock(state_mutex_);
  ++edit_count_;
}

template <class Input>
std::int32_t Scene::append_instances(std::size_t count, const Input& input) {
  const std::lock_guard lock(edit_mutex_);
  MeshSlot* slot = nullptr;
  std::int32_t mesh_id = 0;  // of the slot: neighbours usually have the same mesh
  const auto find = [&](std::int32_t id) {
    if (slot == nullptr || id != mesh_id) slot = &find_mesh(id, "add_instances"), mesh_id = id;
    return slot;
  };
  for (std::size_t i = 0; i < count; ++i) {
    const InstanceInput each = input(i);
    static_cast<void>(find(each.mesh_id));
    check_transform(each.object_to_world, i, "add_instances");
  }
  if (count > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max() - next_instance_id_)) {
    throw EngineError("add_instances: instance ids are used up; make a new Scene");
  }
  const std::size_t size = instances_.size() + count;
  if (size > instances_.capacity()) instances_.reserve(std::max(size, 2 * instances_.size()));
  const std::int32_t first = next_instance_id_;
  for (std::size_t i = 0; i < count; ++i) {
    const InstanceInput each = input(i);
    const std::int32_t id = next_instance_id_++;
    instances_.push_back({id, each.mesh_id, each.object_to_world, each.mask, each.order.value_or(id)});
    ++find(each.mesh_id)->user_count;
  }
  mark_edited();
  return first;
}

std::int32_t Scene::add_instances(std::span<const InstanceInput> inputs) {
  return append_instances(inputs.size(), [inputs](std::size_t i) { return inputs[i]; });
}

template <class T>
std::int32_t Scene::add_instances(std::span<const std::int32_t> mesh_ids, Matrices<T> matrices,
                                  std::span<const std::uint32_t> masks, std::span<const std::int64_t> orders) {
  check_same_length(mesh_ids.size(), matrices.count, "add_instances", "matrices");
  check_same_length(mesh_ids.size(), masks.size(), "add_instances", "masks");
  if (!orders.empty()) check_same_length(mesh_ids.size(), orders.size(), "add_instances", "orders");
  return append_instances(mesh_ids.size(), [&](std::size_t i) {
    InstanceInput input{mesh_ids[i], matrices[i], masks[i], std::nullopt};
    if (!orders.empty()) input.order = orders[i];
    return input;
  });
}
template std::int32_t Scene::add_instances(std::span<const std::int32_t>, Matrices<float>,
                                           std::span<const std::uint32_t>, std::span<const std::int64_t>);
template std::int32_t Scene::add_instances(std::span<const std::int32_t>, Matrices<double>,
                                           std::span<const std::uint32_t>, std::span<const std::int64_t>);

template <class Map>
void Scene::move_instances(std::span<const std::int32_t> ids, const Map& map, ThreadPool& pool) {
  constexpr std::size_t kGrain = 8192;
  const std::lock_guard lock(edit_mutex_);
  const auto rows = find_instances(ids, "set_transforms");
  std::atomic<std::size_t> first_wrong{rows.count};
  parallel_for(pool, rows.count, kGrain, [&](std::size_t begin, std::size_t end) {
    std::size_t row = begin;
    while (row < end && is_sound(map(row))) ++row;
    std::size_t earliest = first_wrong;
    while (row < end && row < earliest && !first_wrong.compare_exchange_weak(earliest, row)) continue;
  });
  if (first_wrong < rows.count) check_transform(map(first_wrong), first_wrong, "set_transforms");
  const std::size_t grain = rows.is_ascending ? kGrain : rows.count;  // the last duplicate wins
  parallel_for(pool, rows.count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) place_still(instances_[rows[i]], map(i));
  });
  mark_edited();
}

void Scene::set_transforms(std::span<const std::int32_t> ids, std::span<const Affine> transforms) {
  check_same_length(ids.size(), transforms.size(), "set_transforms", "transforms");
  ThreadPool alone(1);
  move_instances(ids, [transforms](std::size_t i) { return transforms[i]; }, alone);
}

template <class T>
void Scene::set_transforms(std::span<const std::int32_t> ids, Matrices<T> matrices, ThreadPool& pool) {
  check_same_length(ids.size(), matrices.count, "set_transforms", "matrices");
  move_instances(ids, [matrices](std::size_t i) { return matrices[i]; }, pool);
}
template void Scene::set_transforms(std::span<const std::int32_t>, Matrices<float>, ThreadPool&);
template void Scene::set_transforms(std::span<const std::int32_t>, Matrices<double>, ThreadPool&);

template <class T>
void Scene::set_instance_motion(std::span<const std::int32_t> ids, Matrices<T> matrices, const StepTimes& times) {
  constexpr const char* kName = "set_instance_motion";
  check_same_length(ids.size() * (times.last + std::size_t{1}), matrices.count, kName, "transforms");
  for (std::size_t row = 0; row < matrices.count; ++row) check_transform(matrices[row], row, kName);
  std::vector<std::shared_ptr<const Turns>> turns;
  turns.reserve(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) turns.push_back(make_turns(matrices, i, ids.size(), times));
  const std::lock_guard lock(edit_mutex_);
  const auto rows = find_instances(ids, kName);
  for (std::size_t i = 0; i < rows.count; ++i) {
    instances_[rows[i]].object_to_world = turns[i]->at(kShutterOpens);  // may be between two steps
    instances_[rows[i]].turns = std::move(turns[i]);
  }
  mark_edited();
}
template void Scene::set_instance_motion(std::span<const std::int32_t>, Matrices<float>, const StepTimes&);
template void Scene::set_instance_motion(std::span<const std::int32_t>, Matrices<double>, const StepTimes&);

void Scene::set_masks(std::span<const std::int32_t> ids, std::span<const std::uint32_t> masks) {
  const std::lock_guard lock(edit_mutex_);
  check_same_length(ids.size(), masks.size(), "set_masks", "masks");
  const auto rows = find_instances(ids, "set_masks");
  for (std::size_t i = 0; i < rows.count; ++i) instances_[rows[i]].mask = masks[i];
  mark_edited();
}

void Scene::remove_instances(std::span<const std::int32_t> ids) {
  const std::lock_guard lock(edit_mutex_);
  const auto rows = find_instances(ids, "remove_instances");
  for (std::size_t i = 0; i < rows.count; ++i) {
    Placement& slot = instances_[rows[i]];
    if (slot.id == -1) continue;  // given twice
    --meshes_.at(slot.mesh_id).user_count;
    slot.id = -1;
  }
  std::erase_if(instances_, [](const Placement& slot) { return slot.id == -1; });
  mark_edited();
}

void Scene::mark_stale(std::string why) {
  const std::lock_guard lock(state_mutex_);
  stale_reason_ = std::move(why);
  ++stale_count_;
}

bool Scene::is_current() const {
  const std::lock_guard lock(state_mutex_);
  return snapshot_ != nullptr && edit_count_ == committed_edit_count_ && stale_reason_.empty();
}

std::shared_ptr<const Snapshot> Scene::snapshot() const {
  const std::lock_guard lock(state_mutex_);
  if (!stale_reason_.empty()) throw StaleScene(stale_reason_);
  if (generation_ == 0) throw StaleScene("the scene was never committed; call commit() first");
  if (edit_count_ != committed_edit_count_) {
    throw StaleScene("the scene was edited after the last commit; call commit() first");
  }
  return snapshot_;
}

std::size_t Scene::mesh_count() const {
  const std::lock_guard lock(edit_mutex_);
  return meshes_.size();
}

std::size_t Scene::instance_count() const {
  const std::lock_guard lock(edit_mutex_);
  return instances_.size();
}

}  // namespace perfect_bvh
