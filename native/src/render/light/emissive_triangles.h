// Emissive triangles as lights: next-event estimation samples them, so that rays need not find them by
// chance. In: a snapshot and what its surfaces look like. Out: places on them, the brighter the more of them.
#pragma once

#include <cstdint>
#include <vector>

#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"
#include "tlas/snapshot.h"

namespace perfect_bvh {

struct EmissivePoint {
  Vec3d position{0, 0, 0};
  Vec3f normal{0, 0, 0};    // unit length; it emits to both sides
  Vec3f radiance{0, 0, 0};  // towards everywhere
  float density = 0.0f;     // with which such places are chosen, for each unit of area
  std::uint32_t mask = 0;   // by which rays see it
};

class EmissiveTriangles {
 public:
  // Lists what diffuse rays may meet. Nothing is listed if that would be too much: scenes that emit all over are well
  // served by the surfaces' own rays.
  EmissiveTriangles(const Snapshot& snapshot, const Appearance& appearance);

  [[nodiscard]] bool empty() const noexcept { return triangles_.empty(); }
  // Not to be asked if it is empty. time: at which it is seen.
  [[nodiscard]] EmissivePoint choose(float pick, Point2 place, float time) const;
  // As in an EmissivePoint on a surface of this instance and row of the material table: 0 where none is chosen.
  [[nodiscard]] float density(const Instance& instance, std::int32_t material) const noexcept {
    const bool listed = !empty() && !instance.blas->mesh.is_round() && material != kNoMaterial &&
                        (instance.mask & appearance_.diffuse_mask) != 0;
    return listed ? brightness(material) / static_cast<float>(power()) : 0.0f;
  }

 private:
  struct Triangle {
    std::uint32_t instance, primitive;
    float area;  // by which it is chosen: the largest that it has
  };
  // 0 of what is not worth aiming at.
  [[nodiscard]] float brightness(std::int32_t material) const noexcept;
  [[nodiscard]] bool may_emit(const Instance& instance) const noexcept;
  // False if there is no room for more.
  bool list(std::uint32_t instance_index);
  [[nodiscard]] double power() const noexcept { return powers_.back(); }

  const Snapshot& snapshot_;
  const Appearance& appearance_;
  std::vector<Triangle> triangles_;
  std::vector<double> powers_;  // of each triangle, added up
};

}  // namespace perfect_bvh
