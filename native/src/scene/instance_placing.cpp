#include "scene/instance_placing.h"

#include <cmath>

#include "scene/blas_build.h"
#include "wide/collapse.h"

namespace perfect_bvh {
namespace {

Affine from_centre(Vec3d centre) { return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, centre}; }

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
Aabb transformed_bounds(const Affine& map, const Aabb& box) {
  Aabb result;
  if (box.is_empty()) return result;
  const double reach = std::max(largest_component(to_double(box.lower)), largest_component(to_double(box.upper)));
  const auto row_sum = [&](int axis) { return std::abs(map.x[axis]) + std::abs(map.y[axis]) + std::abs(map.z[axis]); };
  const Vec3d margin = Vec3d{row_sum(0), row_sum(1), row_sum(2)} * (0x1p-17 * reach);
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p = map.point({corner & 1 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                               corner & 4 ? box.upper.z : box.lower.z});
    const Vec3d low = p - margin, high = p + margin;
    result.grow(Vec3f{round_down(low.x), round_down(low.y), round_down(low.z)});
    result.grow(Vec3f{round_up(high.x), round_up(high.y), round_up(high.z)});
  }
  return result;
}

}  // namespace

bool place_instance(Instance& instance, const Blas& blas, const Affine& object_to_world) {
  instance.blas = &blas;
  instance.object_to_world = compose(object_to_world, from_centre(blas.mesh.centre));
  instance.world_to_object = inverse(instance.object_to_world);
  instance.mirrored = object_to_world.determinant() < 0;
  instance.world_bounds = transformed_bounds(instance.object_to_world, blas.tree.bounds());
  return round_trip_holds(instance.object_to_world, instance.world_to_object);
}

std::shared_ptr<const Blas> bake_instance(Instance& instance, const Blas& blas, const Affine& object_to_world,
                                          const BuildConfig& config, ThreadPool& pool, CancelToken& cancel) {
  const Affine to_world = compose(object_to_world, from_centre(blas.mesh.centre));
  Vec3d centre = to_world.point({0, 0, 0});
  auto baked = std::make_shared<Blas>();
  baked->mesh.triangles = blas.mesh.triangles;
  baked->mesh.centre = centre;
  baked->mesh.positions.resize(blas.mesh.positions.size());
  for (std::size_t i = 0; i < baked->mesh.positions.size(); ++i) {
    baked->mesh.positions[i] = to_float(to_world.point(to_double(blas.mesh.positions[i])) - centre);
  }
  baked->tree = build_tree(baked->mesh, config, pool, cancel);
  baked->wide = collapse_mesh(baked->tree, baked->mesh, pool, cancel);
  const bool usable = place_instance(instance, *baked, Affine{});
  // Baked positions are in world winding already.
  instance.mirrored = false;
  instance.baked = true;
  static_cast<void>(usable);  // a translation always has an inverse
  return baked;
}

}  // namespace perfect_bvh
