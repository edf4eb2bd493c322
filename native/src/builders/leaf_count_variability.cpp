// Leaf-count variability (quality.h): lines at random through the root's box, and the leaves that each meets.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "builders/quality.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kLineGrain = 256;

// Numbers that depend on a counter alone, so that any thread may ask for any of them (SplitMix64, Steele et al. 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) noexcept : state_(seed * 0x9E3779B97F4A7C15u) {}
  [[nodiscard]] double next() noexcept {  // from [0, 1)
    state_ += 0x9E3779B97F4A7C15u;
    std::uint64_t z = (state_ ^ (state_ >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

struct Line {
  Vec3d origin;
  Vec3d inverse_direction;

  [[nodiscard]] bool meets(const Bvh2Node& node) const noexcept {
    const Vec3d a = (to_double(node.lower) - origin) * inverse_direction;
    const Vec3d b = (to_double(node.upper) - origin) * inverse_direction;
    const Vec3d near = min(a, b), far = max(a, b);
    return std::max({near.x, near.y, near.z}) <= std::min({far.x, far.y, far.z});
  }
};

// Uniform in direction; uniform in place on the disc that shows the whole sphere around the box, until it meets the
// box: lines are then spread as the SAH has it.
[[nodiscard]] Line random_line(const Bvh2Node& root, Random& random) noexcept {
  const Vec3d lower = to_double(root.lower), upper = to_double(root.upper);
  const Vec3d centre = (lower + upper) * 0.5;
  const double radius = length(upper - lower) * 0.5;
  for (;;) {
    const double z = 2 * random.next() - 1, angle = 6.283185307179586 * random.next();
    const double ring = std::sqrt(1 - z * z);
    const Vec3d direction{ring * std::cos(angle), ring * std::sin(angle), z};
    const Vec3d helper = std::abs(z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0};
    const Vec3d u = normalized(cross(direction, helper)), v = cross(direction, u);
    const double place = radius * std::sqrt(random.next()), turn = 6.283185307179586 * random.next();
    const Line line{centre + u * (place * std::cos(turn)) + v * (place * std::sin(turn)),
                    {1 / direction.x, 1 / direction.y, 1 / direction.z}};
    if (line.meets(root)) return line;
  }
}

[[nodiscard]] double count_leaves(const Bvh2& tree, const Line& line, std::vector<std::uint32_t>& stack) {
  double count = 0;
  stack.assign(1, 0);
  while (!stack.empty()) {
    const Bvh2Node& node = tree.nodes[stack.back()];
    stack.pop_back();
    if (!line.meets(node)) continue;
    if (node.is_leaf()) {
      ++count;
    } else {
      stack.push_back(node.first);
      stack.push_back(node.first + 1);
    }
  }
  return count;
}

}  // namespace

double measure_leaf_count_variability(const Bvh2& tree, std::uint32_t line_count, ThreadPool& pool,
                                      CancelToken& cancel) {
  // A box without area is met by no line.
  if (tree.nodes.size() < 2 || !(tree.bounds().half_area() > 0) || line_count == 0) return 0;
  std::vector<double> counts(line_count);
  parallel_for(pool, line_count, kLineGrain, [&](std::size_t begin, std::size_t end) {
    cancel.checkpoint();
    std::vector<std::uint32_t> stack;
    for (std::size_t i = begin; i < end; ++i) {
      Random random(i + 1);
      counts[i] = count_leaves(tree, random_line(tree.nodes[0], random), stack);
    }
  });
  double sum = 0, squares = 0;
  for (const double count : counts) sum += count;
  const double mean = sum / line_count;
  for (const double count : counts) squares += (count - mean) * (count - mean);
  return std::sqrt(squares / line_count);
}

}  // namespace perfect_bvh
