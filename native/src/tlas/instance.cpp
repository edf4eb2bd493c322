#include "tlas/instance.h"

#include <cmath>

#include "blas/build_tree.h"
#include "blas/moved_mesh.h"
#include "core/cancel.h"
#include "math/vec3.h"
#include "tlas/assemble.h"

namespace perfect_bvh {
namespace {

// Returns the map from the frame in which a mesh is stored.
Affine from_stored(const Affine& object_to_world, Vec3d centre) {
  Affine map = object_to_world;
  map.translation = object_to_world.point(centre);
  return map;
}

// Maps a unit box's corner there and back; the result differs by the rounding of the two maps. A map with an axis of
// zero has no finite inverse.
bool round_trip_holds(const Affine& forth, const Affine& back) {
  if (!is_finite(back.translation)) return false;  // as is the rest, which it is a sum of
  constexpr double kTolerance = 0x1p-24;
  constexpr double kLargestFloat = 3.4028234e38;  // the inverse must still be finite when narrowed to float
  const Vec3d columns[3] = {forth.x, forth.y, forth.z}, inverse_columns[3] = {back.x, back.y, back.z};
  bool holds = true;
  for_each_axis([&](auto column) {
    Vec3d error = back.vector(columns[column]);
    error[column] -= 1.0;
    for_each_axis([&](auto axis) {  // false for NaN, too
      holds &= std::abs(error[axis]) <= kTolerance;
      holds &= std::abs(inverse_columns[column][axis]) < kLargestFloat;
    });
  });
  return holds;
}

Aabb bounds_of(const Blas& blas, const Affine& map, bool is_worth_table) {
  if (keeps_axes(map)) return transformed_bounds(blas.box, map);
  if (!is_worth_table) return transformed_bounds(blas.mesh, blas.box, map);
  if (blas.wide.is_empty) return {};
  return transformed_bounds(blas.support.of(blas.wide, blas.mesh), reach_of(blas.box), map);
}

}  // namespace

bool place_instance(Instance& instance, Placing& placing, const Blas& blas, const Affine& object_to_world,
                    bool is_worth_table) {
  instance.blas = &blas;
  const Affine map = from_stored(object_to_world, blas.mesh.centre);
  instance.object_to_world = map;
  instance.mirrored = map.determinant() < 0;
  instance.motion = 0, instance.turns = nullptr;
  instance.baked = false;  // the row may be reused from a snapshot where it was baked
  placing.world_to_object = inverse(map);
  placing.world_bounds = bounds_of(blas, map, is_worth_table);
  return round_trip_holds(map, placing.world_to_object);
}

namespace {

// Returns the mesh in world space, at all steps if it moves. Without thickness there is no solid: of spheres nothing
// remains.
std::shared_ptr<Mesh> flattened(const Mesh& mesh, const Affine& to_world, CancelToken& cancel) {
  auto copy = std::make_shared<Mesh>();
  const Vec3d centre = to_world.point({0, 0, 0});
  copy->kind = mesh.kind;
  copy->centre = centre;
  copy->triangles = mesh.triangles;
  copy->positions.resize(mesh.positions.size());
  for_steps(copy->positions.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      copy->positions[i] = to_float(to_world.point(to_double(mesh.positions[i])) - centre);
    }
  });
  for (const auto& later : mesh.later) copy->later.push_back(flattened(*later, to_world, cancel));
  copy->times = mesh.times;
  return copy;
}

}  // namespace

Affine place_at(const Instance& instance, float time) {
  if (instance.turns == nullptr) return instance.object_to_world;
  return from_stored(instance.turns->at(time), instance.blas->mesh.centre);
}

Instance posed(const Instance& instance, float time) {
  Instance still = instance;
  still.object_to_world = place_at(instance, time);
  still.mirrored = still.object_to_world.determinant() < 0;
  still.turns = nullptr;
  return still;
}

std::shared_ptr<const Blas> bake_instance(Instance& instance, Placing& placing, const Blas& blas,
                                          const Affine& object_to_world, const BuildConfig& config, ThreadPool& pool,
                                          CancelToken& cancel) {
  const Affine to_world = from_stored(object_to_world, blas.mesh.centre);
  auto baked = std::make_shared<Blas>(flattened(blas.mesh, to_world, cancel));
  baked->config = config;
  MeshReport unread;
  build_wide_tree(*baked, unread, pool, cancel);
  baked->round_leaves = view_leaves(baked->wide, baked->mesh);
  add_motion_steps(*baked, pool, cancel);
  const bool usable = place_instance(instance, placing, *baked, Affine{});
  // Baked positions are in world winding already.
  instance.mirrored = false;
  instance.baked = true;
  static_cast<void>(usable);  // a translation always has an inverse
  return baked;
}

}  // namespace perfect_bvh
