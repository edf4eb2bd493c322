// How many of a scene's rays a mesh may expect.
// A random line that meets the scene's box meets a box inside it with the ratio of their areas (the premise of the
// SAH). So an instance gets the area of its world box as a share of the scene's, and a mesh the sum over its instances:
// more than one where they overlap each other. Occlusion is ignored: it is unknown before rays are cast.
#pragma once

#include <vector>

#include "math/aabb.h"
#include "math/affine.h"

namespace perfect_bvh {

class RayShares {
 public:
  explicit RayShares(std::size_t mesh_count) : areas_(mesh_count, 0.0) {}

  static constexpr std::size_t kOther = ~std::size_t{0};
  // An instance. box: in the frame that `map` maps from. row: of the mesh, kOther for a mesh whose share is not needed.
  void add(const Aabb& box, const Affine& map, std::size_t row) noexcept;
  // Of the mesh in a row. All of the rays, if the scene's box has no area.
  [[nodiscard]] double of(std::size_t row) const noexcept;

 private:
  Vec3d lower_{1, 1, 1}, upper_{-1, -1, -1};  // of the scene
  bool is_empty_ = true;
  std::vector<double> areas_;  // of each mesh's world boxes
};

}  // namespace perfect_bvh
