#include "instance_layouts.h"

#include <cmath>
#include <random>
#include <stdexcept>

namespace perfect_bvh::bench {
namespace {

using Random = std::mt19937;

double uniform(Random& random, double from, double to) {
  return from + (to - from) * static_cast<double>(random()) * 0x1p-32;
}

// A random rotation: a unit quaternion, drawn from inside the unit ball.
Affine random_rotation(Random& random) {
  double q[4], square = 0;
  do {
    square = 0;
    for (double& c : q) c = uniform(random, -1, 1), square += c * c;
  } while (square > 1 || square < 1e-3);
  for (double& c : q) c /= std::sqrt(square);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
          {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
          {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)},
          {0, 0, 0}};
}

}  // namespace

std::vector<Affine> place_instances(const std::string& layout, const Aabb& mesh, std::size_t count, unsigned seed) {
  if (layout != "grid" && layout != "heap") throw std::runtime_error("layout must be grid or heap, got " + layout);
  const Vec3d centre = to_double(mesh.lower + mesh.upper) * 0.5;
  const double spacing = length(to_double(mesh.extent())) * (layout == "grid" ? 1.0 : 0.25);
  const auto side = static_cast<std::size_t>(std::ceil(std::cbrt(static_cast<double>(count))));
  Random random(seed);
  std::vector<Affine> placed(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t cell[3] = {i % side, i / side % side, i / side / side};
    Affine map = random_rotation(random);
    const double size = uniform(random, 0.7, 1.3);
    map.x = map.x * size, map.y = map.y * size, map.z = map.z * size;
    Vec3d place;
    for (int axis = 0; axis < 3; ++axis) {
      place[axis] = (static_cast<double>(cell[axis]) + uniform(random, -0.3, 0.3)) * spacing;
    }
    map.translation = place - map.vector(centre);
    // Rounded to float, so that every peer gets exactly the same transform.
    for (Vec3d* column : {&map.x, &map.y, &map.z, &map.translation}) *column = to_double(to_float(*column));
    placed[i] = map;
  }
  return placed;
}

}  // namespace perfect_bvh::bench
