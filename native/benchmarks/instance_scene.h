// A scene of many instances of one mesh, as benchmarks of top levels see it: ours or Embree's.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "math/aabb.h"
#include "mesh/mesh.h"
#include "ray_caster.h"

namespace perfect_bvh::bench {

// Made with the mesh's own tree built, and no instances yet.
class InstanceScene {
 public:
  InstanceScene() = default;
  virtual ~InstanceScene() = default;
  InstanceScene(const InstanceScene&) = delete;
  InstanceScene& operator=(const InstanceScene&) = delete;

  // Not timed: the transforms in the format in which the engine takes them next.
  virtual void prepare(std::span<const Affine> transforms) = 0;
  // Timed: as many instances, at what was prepared; the scene has none so far.
  virtual void add() = 0;
  // Timed: all instances go to what was prepared.
  virtual void move() = 0;
  // Timed: what was added or moved can be traced from now on.
  virtual void commit() = 0;
  // Of the last commit.
  [[nodiscard]] virtual std::shared_ptr<RayCaster> caster() const = 0;
};

// embree: geometries at MEDIUM; low: those at LOW in a dynamic scene, which is Embree's choice for what moves each
// frame; array: one array at MEDIUM; array_low: that like low. Throws std::runtime_error for other names. The mesh's
// own tree is always MEDIUM.
[[nodiscard]] std::unique_ptr<InstanceScene> make_embree_instances(const std::string& name, const Mesh& mesh,
                                                                   int thread_count);

}  // namespace perfect_bvh::bench
