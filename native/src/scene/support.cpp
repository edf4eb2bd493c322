#include "scene/support.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/float4.h"
#include "scene/cover.h"

namespace perfect_bvh {
namespace {

// Finds the vertex of a tree that is farthest along a direction. What the last search found is where the next begins:
// in nearly the same direction hardly a box reaches further.
class Search {
 public:
  Search(const WideBvh& tree, const TriangleMesh& mesh) : tree_(tree), mesh_(mesh) {
    waiting_.push_back({0.0f, tree.root});
    direction_ = {1, 0, 0};
    reach_ = -Aabb::kInfinity;
    visit_all();
  }

  [[nodiscard]] float farthest(Vec3f direction) {
    direction_ = direction;
    reach_ = dot(direction, farthest_);
    waiting_.push_back({Aabb::kInfinity, tree_.root});
    visit_all();
    return reach_;
  }

 private:
  struct Waiting {
    float bound;
    std::uint32_t child;
  };

  void visit_all() {
    while (!waiting_.empty()) {
      const Waiting now = waiting_.back();
      waiting_.pop_back();
      if (now.bound < reach_) continue;
      if (now.child >= kBlockChild) {
        visit_leaf(now.child - kBlockChild);
      } else {
        visit_node(tree_.nodes[now.child]);
      }
    }
  }

  // The child that may reach farthest comes last, so that it is visited first.
  void visit_node(const WideNode& node) {
    const float* const x = node.planes[direction_.x > 0 ? 1 : 0];
    const float* const y = node.planes[direction_.y > 0 ? 3 : 2];
    const float* const z = node.planes[direction_.z > 0 ? 5 : 4];
    const std::size_t first = waiting_.size();
    for (std::size_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const float bound = direction_.x * x[lane] + direction_.y * y[lane] + direction_.z * z[lane];
      if (bound < reach_) continue;
      waiting_.push_back({bound, node.child[lane]});
      if (waiting_[first].bound < bound) std::swap(waiting_[first], waiting_.back());
    }
    if (waiting_.size() > first) std::swap(waiting_[first], waiting_.back());
  }

  void visit_leaf(std::uint32_t leaf) {
    if (tree_.layout == TreeLayout::kDefault) {
      const auto& [x, y, z] = tree_.blocks[leaf].vertices;
      for (std::size_t lane = 0; lane < 8; ++lane) visit_vertex({x[lane], y[lane], z[lane]});
      return;
    }
    for (const std::uint32_t primitive : tree_.indexed_leaves[leaf].primitives) {
      const TriangleIndices corners = mesh_.triangles[primitive];
      for (const std::uint32_t i : {corners.x, corners.y, corners.z}) visit_vertex(mesh_.positions[i] * tree_.scale);
    }
  }

  void visit_vertex(Vec3f vertex) {
    const float reach = dot(direction_, vertex);
    if (reach > reach_) reach_ = reach, farthest_ = vertex;
  }

  const WideBvh& tree_;
  const TriangleMesh& mesh_;
  Vec3f direction_{0, 0, 0}, farthest_{0, 0, 0};
  float reach_ = 0;
  std::vector<Waiting> waiting_;
};

}  // namespace

SupportTable::SupportTable(const WideBvh& tree, const TriangleMesh& mesh)
    : unit_(1.0 / static_cast<double>(tree.scale)) {
  Search forward(tree, mesh), backward(tree, mesh);
  const auto place = [](int cell) { return static_cast<float>(cell) * (2.0f / kCells) - 1.0f; };
  for (int axis = 0; axis < 3; ++axis) {
    for (int row = 0; row <= kCells; ++row) {
      for (int step = 0; step <= kCells; ++step) {
        const int column = row % 2 == 0 ? step : kCells - step;  // to and fro: neighbours one after the other
        Vec3f direction{0, 0, 0};
        direction[axis] = 1.0f;
        direction[(axis + 1) % 3] = place(row);
        direction[(axis + 2) % 3] = place(column);
        samples_[axis][row][column] = {forward.farthest(direction), backward.farthest(-direction)};
      }
    }
  }
}

// Without branches: where instances are turned at random, which face and which side it is cannot be foretold.
SupportTable::Range SupportTable::along(Vec3d row) const noexcept {
  constexpr int kNext[5] = {0, 1, 2, 0, 1};
  const double entry[3] = {row.x, row.y, row.z};
  const double size[3] = {std::abs(row.x), std::abs(row.y), std::abs(row.z)};
  const int longer = size[1] > size[0] ? 1 : 0;
  const int axis = size[2] > size[longer] ? 2 : longer;
  if (!(size[axis] > 0)) return {0, 0};
  const double scale = 1.0 / entry[axis];
  const auto cell_of = [&](int other) { return static_cast<float>((entry[other] * scale + 1.0) * (kCells / 2)); };
  const float u = cell_of(kNext[axis + 1]), v = cell_of(kNext[axis + 2]);
  const int i = std::clamp(static_cast<int>(u), 0, kCells - 1), j = std::clamp(static_cast<int>(v), 0, kCells - 1);
  const float right = u - static_cast<float>(i), up = v - static_cast<float>(j);
  // Forward and backward of two neighbours at once.
  const Float4 low = Float4::load_unaligned(&samples_[axis][i][j]);
  const Float4 high = Float4::load_unaligned(&samples_[axis][i + 1][j]);
  alignas(16) float ends[4];
  (low + (high - low) * Float4(right)).store(ends);
  const double unit = size[axis] * unit_;
  const double reach[2] = {static_cast<double>(ends[1] + (ends[3] - ends[1]) * up) * unit,
                           static_cast<double>(ends[0] + (ends[2] - ends[0]) * up) * unit};
  const int is_forward = entry[axis] > 0 ? 1 : 0;
  return {-reach[1 - is_forward], reach[is_forward]};
}

Aabb transformed_bounds(const SupportTable& support, double reach, const Affine& map) {
  Aabb box;
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d row{map.x[axis], map.y[axis], map.z[axis]};
    const SupportTable::Range range = support.along(row);
    set_range(box, axis, map.translation[axis], range.least, range.greatest, reach, row);
  }
  return box;
}

}  // namespace perfect_bvh
