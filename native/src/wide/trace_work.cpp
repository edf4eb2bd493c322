#include "wide/trace_work.h"

#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

double half_area(const Aabb& box) noexcept {
  const Vec3d e = to_double(box.upper) - to_double(box.lower);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

}  // namespace

TraceWork measure_trace_work(const WideBvh& tree, const TriangleMesh& mesh) noexcept {
  if (tree.is_empty) return {};
  const double root_area = half_area(bounds_of(tree, mesh));
  if (!(root_area > 0)) return {};
  if (tree.nodes.empty()) return {0, 1};
  double node_area = root_area, leaf_area = 0;
  for (const WideNode& node : tree.nodes) {
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      (node.child[lane] < kBlockChild ? node_area : leaf_area) += half_area(child_box(node, lane));
    }
  }
  return {node_area / root_area, leaf_area / root_area};
}

}  // namespace perfect_bvh
