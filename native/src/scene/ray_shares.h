// How many rays a commit reckons with.
//
// What the caller expects counts. A commit that is told nothing expects what the last one did that was told, or what
// was cast since the last commit if that is more. Where none was ever told the number stays unknown: trees are chosen
// by usage, and what was cast is kept apart, see make_blas.h. To expect none says nothing of later commits.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "math/aabb.h"

namespace perfect_bvh {

struct RayForecast {
  std::optional<double> expected;  // before the next commit
  double cast = 0;                 // since the last one
  std::uint64_t cast_in_all = 0;   // until now

  [[nodiscard]] double likely() const noexcept { return expected.value_or(cast); }
};

// Ray shares ----------------------------------------------------------------------------------------------------------
// How many of a scene's rays a mesh may expect.
// A random line that meets the scene's box meets a box inside it with the ratio of their areas (the premise of the
// SAH). So an instance gets the area of its world box as a share of the scene's, and a mesh the sum over its instances:
// more than one where they overlap each other. Occlusion is ignored: it is unknown before rays are cast.

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
