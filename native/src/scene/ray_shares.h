// The number of rays that a commit expects.
//
// A number given by the caller is used. A commit without one uses the number that was given last, or the rays cast
// since the last commit if they are more. If none was ever given, the number stays unknown: trees are chosen by usage,
// and the rays cast are counted separately, see make_blas.h. An expectation of 0 does not affect later commits.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "math/aabb.h"

namespace perfect_bvh {

struct RayForecast {
  std::optional<double> expected;  // before the next commit
  double cast = 0;                 // since the last commit
  std::uint64_t cast_in_all = 0;   // in total

  [[nodiscard]] double likely() const noexcept { return expected.value_or(cast); }
};

// Ray shares ----------------------------------------------------------------------------------------------------------
// The number of a scene's rays that a mesh may expect.
// A random line that hits the scene's box hits a box inside it with a probability of the ratio of their areas (the
// premise of the SAH). So an instance gets the area of its world box as a share of the scene's, and a mesh gets the sum
// over its instances: more than one if they overlap. Occlusion is ignored: it is unknown before rays are cast.

class RayShares {
 public:
  explicit RayShares(std::size_t mesh_count) : areas_(mesh_count, 0.0) {}

  static constexpr std::size_t kOther = ~std::size_t{0};
  // Adds an instance. box: in the frame that `map` maps from. row: of the mesh, or kOther for a mesh whose share is not
  // needed.
  void add(const Aabb& box, const Affine& map, std::size_t row) noexcept;
  // Returns the share of the mesh in a row. All of the rays, if the scene's box has no area.
  [[nodiscard]] double of(std::size_t row) const noexcept;

 private:
  Vec3d lower_{1, 1, 1}, upper_{-1, -1, -1};  // of the scene
  bool is_empty_ = true;
  std::vector<double> areas_;  // of each mesh's world boxes
};

}  // namespace perfect_bvh
