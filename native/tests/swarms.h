// A mesh in several shapes, as animations have it: what one tree for all frames is tried on.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "builders/sampled_tree.h"
#include "tests/mesh_sets.h"

namespace perfect_bvh::test {

class Shapes final : public SampledBoxes {
 public:
  explicit Shapes(std::vector<Mesh> meshes) : meshes_(std::move(meshes)) {}
  [[nodiscard]] std::size_t sample_count() const noexcept override { return meshes_.size(); }
  [[nodiscard]] Aabb box(std::size_t sample, std::uint32_t prim_index) const noexcept override {
    return meshes_[sample].primitive_box(prim_index);
  }
  [[nodiscard]] const Mesh& operator[](std::size_t i) const { return meshes_[i]; }

 private:
  std::vector<Mesh> meshes_;
};

// Four swarms of triangles that are in one place at first, fly apart all at once and come back.
inline Shapes swarms(std::size_t count, std::size_t size = 1200) {
  const Mesh still = triangle_soup(size, 0.05f);
  constexpr Vec3f kWays[] = {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}, {-3, -3, 0}};
  std::vector<Mesh> shapes(count, still);
  for (std::size_t i = 0; i < count; ++i) {
    const float place = static_cast<float>(i) / static_cast<float>(count - 1);
    const float far = std::pow(std::sin(3.1f * place), 0.2f);
    for (std::size_t v = 0; v < still.positions.size(); ++v) {
      shapes[i].positions[v] = still.positions[v] + kWays[v / 3 % 4] * far;
    }
  }
  return Shapes(std::move(shapes));
}

}  // namespace perfect_bvh::test
