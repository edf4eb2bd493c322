#include "builders/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/cancel.h"

namespace perfect_bvh {
namespace {

double half_area(const Bvh2Node& node) noexcept { return half_area(to_double(node.upper) - to_double(node.lower)); }

// Returns 0 if the boxes do not intersect.
double overlap(const Bvh2Node& a, const Bvh2Node& b) noexcept {
  const Vec3d e = to_double(min(a.upper, b.upper)) - to_double(max(a.lower, b.lower));
  return e.x < 0 || e.y < 0 || e.z < 0 ? 0 : half_area(e);
}

std::size_t count_distinct(std::span<const std::uint32_t> numbers, CancelToken& cancel) {
  std::uint32_t largest = 0;
  for_steps(numbers.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint32_t number : numbers.subspan(begin, end - begin)) largest = std::max(largest, number);
  });
  std::vector<bool> is_seen(largest + std::size_t{1});
  std::size_t count = 0;
  for_steps(numbers.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint32_t number : numbers.subspan(begin, end - begin)) {
      count += !is_seen[number];
      is_seen[number] = true;
    }
  });
  return count;
}

}  // namespace

TreeQuality measure_quality(const Bvh2& tree, CancelToken& cancel) {
  TreeQuality quality;
  if (tree.empty()) return quality;
  quality.node_count = tree.node_count();
  quality.depth = tree.depth;
  quality.is_refittable = tree.refittable;
  double leaf_area = 0, interior_area = 0, overlap_area = 0;
  const auto add = [&](std::size_t i) {
    const Bvh2Node& node = tree.nodes[i];
    if (node.is_leaf()) {
      ++quality.leaf_count;
      quality.reference_count += node.count;
      quality.max_leaf_size = std::max(quality.max_leaf_size, node.count);
      leaf_area += half_area(node) * node.count;
    } else if (i != 1) {
      interior_area += half_area(node);
      overlap_area += overlap(tree.nodes[node.first], tree.nodes[node.first + 1]);
    }
  };
  for_steps(tree.nodes.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) add(i);
  });
  quality.primitive_count = tree.refittable ? quality.reference_count : count_distinct(tree.prim_indices, cancel);
  quality.sibling_overlap = interior_area > 0 ? overlap_area / interior_area : 0;
  const double root_area = half_area(tree.nodes[0]);
  // No random ray hits a tree without area. Its number of primitives is used instead, as for any ray that does hit it.
  quality.node_visits = root_area > 0 ? interior_area / root_area : 0;
  quality.primitive_tests = root_area > 0 ? leaf_area / root_area : static_cast<double>(quality.reference_count);
  quality.sah = quality.node_visits + quality.primitive_tests;
  return quality;
}

// Epo -----------------------------------------------------------------------------------------------------------------
// End-point overlap: the cost for a ray of nodes whose boxes contain a surface that is not in them (Aila, Karras and
// Laine 2013, "On quality metrics of bounding volume hierarchies", section 4). A ray ends on a surface; the nodes
// around that point are visited even if they do not contain the surface. SAH ignores this, and trees of equal SAH
// differ in it.
// In: a tree and the triangles it was built over. Out: the expected cost of those visits, comparable with the SAH.

namespace {

constexpr std::size_t kGrain = 512;

// A triangle cut by up to six planes: at most nine corners.
class Polygon {
 public:
  Polygon(Vec3d a, Vec3d b, Vec3d c) noexcept : corners_{a, b, c}, count_(3) {}

  // Clips to the box; Sutherland and Hodgman 1974.
  void clip(const Aabb& box) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      clip(axis, static_cast<double>(box.lower[axis]), 1.0);
      clip(axis, static_cast<double>(box.upper[axis]), -1.0);
    }
  }
  [[nodiscard]] double area() const noexcept {
    Vec3d sum{0, 0, 0};
    for (std::size_t i = 2; i < count_; ++i)
      sum = sum + cross(corners_[i - 1] - corners_[0], corners_[i] - corners_[0]);
    return 0.5 * length(sum);
  }

 private:
  // Keeps the part with sign * (coordinate - border) >= 0.
  void clip(int axis, double border, double sign) noexcept {
    std::array<Vec3d, 9> kept;
    std::size_t kept_count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec3d from = corners_[i], to = corners_[(i + 1) % count_];
      const double from_distance = sign * (from[axis] - border), to_distance = sign * (to[axis] - border);
      if (from_distance >= 0) kept[kept_count++] = from;
      if ((from_distance > 0 && to_distance < 0) || (from_distance < 0 && to_distance > 0)) {
        Vec3d cut = from + (to - from) * (from_distance / (from_distance - to_distance));
        cut[axis] = border;
        kept[kept_count++] = cut;
      }
    }
    std::copy_n(kept.begin(), kept_count, corners_.begin());
    count_ = kept_count;
  }

  std::array<Vec3d, 9> corners_;
  std::size_t count_;
};

struct Topology {
  std::vector<std::uint32_t> parents;      // of each node
  std::vector<std::uint32_t> leaf_starts;  // rows of `leaves` for each primitive; one more at the end
  std::vector<std::uint32_t> leaves;       // that refer to a primitive

  Topology(const Bvh2& tree, std::size_t primitive_count)
      : parents(tree.nodes.size(), 0), leaf_starts(primitive_count + 1, 0), leaves(tree.prim_indices.size()) {
    for (const std::uint32_t prim : tree.prim_indices) ++leaf_starts[prim + 1];
    for (std::size_t i = 1; i < leaf_starts.size(); ++i) leaf_starts[i] += leaf_starts[i - 1];
    auto next = leaf_starts;
    for (std::uint32_t i = 0; i < tree.nodes.size(); ++i) {
      const Bvh2Node& node = tree.nodes[i];
      for (std::uint32_t row = 0; row < node.count; ++row) leaves[next[tree.prim_indices[node.first + row]]++] = i;
      if (!node.is_leaf() && i != 1) parents[node.first] = parents[node.first + 1] = i;
    }
  }
};

// Prices one triangle after another. Stamps mark the nodes above the present one.
class Pricer {
 public:
  Pricer(const Bvh2& tree, const Topology& topology)
      : tree_(tree), topology_(topology), stamps_(tree.nodes.size(), 0) {}

  [[nodiscard]] double price(std::uint32_t prim, const Polygon& triangle) {
    stamp_ancestors(prim);
    double cost = 0;
    stack_.clear();
    stack_.emplace_back(0, triangle);
    while (!stack_.empty()) {
      auto [index, polygon] = stack_.back();
      stack_.pop_back();
      const Bvh2Node& node = tree_.nodes[index];
      polygon.clip(node.box());
      const double area = polygon.area();
      if (!(area > 0)) continue;
      const bool is_own = stamps_[index] == prim + 1;
      if (!is_own) cost += area * (node.is_leaf() ? static_cast<double>(node.count) : 1.0);
      if (node.is_leaf()) continue;
      stack_.emplace_back(node.first, polygon);
      stack_.emplace_back(node.first + 1, polygon);
    }
    return cost;
  }

 private:
  void stamp_ancestors(std::uint32_t prim) {
    for (std::uint32_t row = topology_.leaf_starts[prim]; row < topology_.leaf_starts[prim + 1]; ++row) {
      std::uint32_t node = topology_.leaves[row];
      for (; stamps_[node] != prim + 1; node = topology_.parents[node]) stamps_[node] = prim + 1;
    }
  }

  const Bvh2& tree_;
  const Topology& topology_;
  std::vector<std::uint32_t> stamps_;
  std::vector<std::pair<std::uint32_t, Polygon>> stack_;
};

}  // namespace

double measure_epo(const Bvh2& tree, std::span<const Vec3f> positions, std::span<const Vec3<std::uint32_t>> triangles,
                   ThreadPool& pool, CancelToken& cancel) {
  if (tree.empty()) return 0;
  const Topology topology(tree, triangles.size());
  struct Sums {
    double cost = 0, area = 0;
  };
  std::vector<Sums> chunks((triangles.size() + kGrain - 1) / kGrain);
  // Several chunks per task, because each pricer has a stamp for every node.
  const std::size_t chunks_a_task = chunks.size() / static_cast<std::size_t>(4 * pool.thread_count()) + 1;
  parallel_for(pool, chunks.size(), chunks_a_task, [&](std::size_t begin, std::size_t end) {
    Pricer pricer(tree, topology);
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      cancel.checkpoint();
      const std::size_t first = chunk * kGrain, last = std::min(triangles.size(), first + kGrain);
      cancel.advance(last - first);
      for (std::size_t i = first; i < last; ++i) {
        const Vec3<std::uint32_t> t = triangles[i];
        const Polygon polygon(to_double(positions[t.x]), to_double(positions[t.y]), to_double(positions[t.z]));
        chunks[chunk].area += polygon.area();
        chunks[chunk].cost += pricer.price(static_cast<std::uint32_t>(i), polygon);
      }
    }
  });
  Sums all;
  for (const Sums& chunk : chunks) all.cost += chunk.cost, all.area += chunk.area;
  return all.area > 0 ? all.cost / all.area : 0;
}

// Leaf count variability ----------------------------------------------------------------------------------------------
// Leaf-count variability (quality.h): counts the leaves that random lines through the root's box hit.

namespace {

constexpr std::size_t kLineGrain = 256;

// Random numbers that depend only on a counter, so that any thread can compute any of them (SplitMix64, Steele et al.
// 2014).
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

// Returns a line with uniform direction, and uniform position on the disc that is the projection of the sphere around
// the box; repeated until the line hits the box. Lines are then distributed as the SAH assumes.
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
  // No line hits a box without area.
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
