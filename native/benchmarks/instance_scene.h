// A scene of many instances of one mesh, for benchmarks of top levels: ours or Embree's.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "math/aabb.h"
#include "mesh/mesh.h"
#include "ray_caster.h"

namespace perfect_bvh::bench {

// Starts with the mesh's own tree built, and without instances.
class InstanceScene {
 public:
  InstanceScene() = default;
  virtual ~InstanceScene() = default;
  InstanceScene(const InstanceScene&) = delete;
  InstanceScene& operator=(const InstanceScene&) = delete;

  // Not timed: stores the next transforms in the engine's format.
  virtual void prepare(std::span<const Affine> transforms) = 0;
  // Timed: adds one instance for each prepared transform; the scene must be empty.
  virtual void add() = 0;
  // Timed: moves all instances to the prepared transforms.
  virtual void move() = 0;
  // Timed: makes added or moved instances ready for tracing.
  virtual void commit() = 0;
  // Casts rays at the last committed scene.
  [[nodiscard]] virtual std::shared_ptr<RayCaster> caster() const = 0;
};

// embree: geometries at MEDIUM; low: geometries at LOW in a dynamic scene, which Embree recommends for objects that
// move each frame; array: one array at MEDIUM; array_low: one array, like low. Throws std::runtime_error for other
// names. The mesh's own tree is always MEDIUM.
[[nodiscard]] std::unique_ptr<InstanceScene> make_embree_instances(const std::string& name, const Mesh& mesh,
                                                                   int thread_count);

}  // namespace perfect_bvh::bench
