#include "mesh_motions.h"

#include <cmath>
#include <utility>

namespace perfect_bvh::bench {

Aabb bounds_of_positions(const Positions& positions) {
  Aabb box;
  for (const Vec3f& position : positions) box.grow(position);
  return box;
}

namespace {

int longest_axis(const Aabb& box) {
  const Vec3f e = box.extent();
  return e.x >= e.y ? (e.x >= e.z ? 0 : 2) : (e.y >= e.z ? 1 : 2);
}

}  // namespace

Positions twisted(Positions positions, float radians) {
  const Aabb box = bounds_of_positions(positions);
  const int axis = longest_axis(box), u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vec3f centre = (box.lower + box.upper) * 0.5f;
  for (Vec3f& p : positions) {
    const float turn = radians * ((p[axis] - box.lower[axis]) / box.extent()[axis]);
    const float c = std::cos(turn), s = std::sin(turn), x = p[u] - centre[u], y = p[v] - centre[v];
    p[u] = centre[u] + c * x - s * y;
    p[v] = centre[v] + s * x + c * y;
  }
  return positions;
}

Positions swayed(Positions positions, int frame) {
  const Aabb box = bounds_of_positions(positions);
  const int axis = longest_axis(box), u = (axis + 1) % 3;
  const float length = box.extent()[axis], phase = 0.7f * static_cast<float>(frame);
  for (Vec3f& p : positions) p[u] += 0.02f * length * std::sin(phase + 6.0f * (p[axis] - box.lower[axis]) / length);
  return positions;
}

Mesh with(const Mesh& mesh, Positions positions) {
  Mesh result = mesh;
  result.positions = std::move(positions);
  return result;
}

}  // namespace perfect_bvh::bench
