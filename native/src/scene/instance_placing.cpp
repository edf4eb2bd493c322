#include "scene/instance_placing.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/blas_build.h"
#include "wide/collapse.h"

namespace perfect_bvh {
namespace {

Affine from_centre(Vec3d centre) { return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, centre}; }

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double largest_component(Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

// Maps a unit box's corner there and back: what returns differs by the rounding of the two maps.
bool round_trip_holds(const Affine& forth, const Affine& back) {
  if (!back.is_finite()) return false;
  constexpr double kTolerance = 0x1p-24;
  for (const Vec3d probe : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    if (largest_component(back.vector(forth.vector(probe)) - probe) > kTolerance) return false;
    // An axis that is squeezed below what float can tell apart from nothing is as good as flat.
    if (!(largest_component(forth.vector(probe)) > 0)) return false;
  }
  // Narrowed to float the inverse must still be finite.
  constexpr double kLargestFloat = 3.4028234e38;
  return largest_component(back.x) < kLargestFloat && largest_component(back.y) < kLargestFloat &&
         largest_component(back.z) < kLargestFloat;
}

// The box of a mesh in world space, wide enough that every hit in the mesh lies inside it. Tracing moves a hit by less
// than 100 * 2^-24 of the mesh's reach on each of its axes (math/slab.h, with |origin| <= 4 reach and the narrowing of
// the ray); the inverse may be off by as much as place_instance() accepts. 2^-17 covers both.
double margin_of(const Affine& map, double reach, int axis) {
  return (std::abs(map.x[axis]) + std::abs(map.y[axis]) + std::abs(map.z[axis])) * (0x1p-17 * reach);
}

// Centre and half extent: the extent along a world axis is that of the box along the axis's row.
void grow_transformed(Vec3d& lower, Vec3d& upper, const Affine& map, const Aabb& box) {
  const Vec3d low = to_double(box.lower), high = to_double(box.upper);
  const Vec3d centre = map.point((low + high) * 0.5), half = (high - low) * 0.5;
  for (int axis = 0; axis < 3; ++axis) {
    const double extent =
        std::abs(map.x[axis]) * half.x + std::abs(map.y[axis]) * half.y + std::abs(map.z[axis]) * half.z;
    lower[axis] = std::min(lower[axis], centre[axis] - extent);
    upper[axis] = std::max(upper[axis], centre[axis] + extent);
  }
}

Aabb transformed_bounds(const Affine& map, const Blas& blas) {
  Aabb bounds;
  for (const Aabb& box : blas.cover) bounds.grow(box);
  if (bounds.is_empty()) return {};
  const double reach = std::max(largest_component(to_double(bounds.lower)), largest_component(to_double(bounds.upper)));
  Vec3d lower{kInfinity, kInfinity, kInfinity}, upper{-kInfinity, -kInfinity, -kInfinity};
  for (const Aabb& box : blas.cover) grow_transformed(lower, upper, map, box);
  Aabb result;
  for (int axis = 0; axis < 3; ++axis) {
    const double margin = margin_of(map, reach, axis);
    result.lower[axis] = round_down(lower[axis] - margin);
    result.upper[axis] = round_up(upper[axis] + margin);
  }
  return result;
}

}  // namespace

bool place_instance(Instance& instance, const Blas& blas, const Affine& object_to_world) {
  instance.blas = &blas;
  instance.object_to_world = compose(object_to_world, from_centre(blas.mesh.centre));
  instance.world_to_object = inverse(instance.object_to_world);
  instance.mirrored = object_to_world.determinant() < 0;
  instance.world_bounds = transformed_bounds(instance.object_to_world, blas);
  return round_trip_holds(instance.object_to_world, instance.world_to_object);
}

std::shared_ptr<const Blas> bake_instance(Instance& instance, const Blas& blas, const Affine& object_to_world,
                                          const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  const Affine to_world = compose(object_to_world, from_centre(blas.mesh.centre));
  Vec3d centre = to_world.point({0, 0, 0});
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->triangles = blas.mesh.triangles;
  mesh->centre = centre;
  mesh->positions.resize(blas.mesh.positions.size());
  for (std::size_t i = 0; i < mesh->positions.size(); ++i) {
    mesh->positions[i] = to_float(to_world.point(to_double(blas.mesh.positions[i])) - centre);
  }
  auto baked = std::make_shared<Blas>(std::move(mesh));
  const Bvh2 tree = build_tree(baked->mesh, config, pool, cancel);
  baked->config = config;
  baked->quality = measure_quality(tree);
  baked->cover = {tree.bounds()};  // it is never turned
  baked->wide = collapse_mesh(tree, baked->mesh, pool, cancel);
  const bool usable = place_instance(instance, *baked, Affine{});
  // Baked positions are in world winding already.
  instance.mirrored = false;
  instance.baked = true;
  static_cast<void>(usable);  // a translation always has an inverse
  return baked;
}

}  // namespace perfect_bvh
