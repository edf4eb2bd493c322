#include "wide/run_cutter.h"

#include <algorithm>
#include <array>

#include "builders/morton.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kAhead = 16;  // triangles prefetched
// Measured on four meshes: if runs are whole subtrees, they hold 14 to 18% fewer triangles, in trees that cost rays 1.3
// to 3.9% less. Within subtrees of 64 they hold 2% more triangles, and trees cost up to 3% more.
constexpr std::size_t kSubtree = 32;
constexpr std::uint64_t kBorderOfChunk = ~std::uint64_t{0};

// kNewness[k][b], for corner k of a triangle whose vertex occurred last b corners ago: a one in digit d (4 bits) if it
// is new in a run that starts d triangles before this one.
using Newness = std::array<std::array<std::uint32_t, kMostBack + 1>, 3>;
constexpr Newness make_newness() noexcept {
  Newness table{};
  for (std::uint32_t k = 0; k < 3; ++k) {
    for (std::uint32_t back = 1; back <= kMostBack; ++back) {
      const std::uint32_t triangles_ago = std::min((back + 2 - k) / 3, kLeafSize);
      table[k][back] = triangles_ago == kLeafSize ? 0x11111111u : 0x11111111u & ((1u << (4 * triangles_ago)) - 1);
    }
  }
  return table;
}
constexpr Newness kNewness = make_newness();

}  // namespace

Runs make_room_for_runs(const Mesh& mesh, Scratch& scratch) {
  Runs runs;
  const std::size_t count = mesh.primitive_count();
  runs.sizes = scratch.take<std::uint8_t>(count);
  runs.counts = scratch.take<std::uint32_t>((count + kRunChunk - 1) / kRunChunk);
  const std::size_t corner_count = 3 * mesh.triangles.size();
  runs.corners = scratch.take<std::uint32_t>(corner_count + kCornersAhead);
  std::fill(runs.corners.end() - kCornersAhead, runs.corners.end(), 0u);
  runs.way_back = scratch.take<std::uint8_t>(corner_count);
  return runs;
}

RunCutter::RunCutter(const Mesh& mesh, const TriangleOrder& order, std::span<std::uint32_t> last_corners, Runs& runs,
                     CancelToken& cancel)
    : mesh_(mesh), order_(order), last_corners_(last_corners), runs_(runs) {
  for_steps(last_corners_.size(), cancel, [&](std::size_t begin, std::size_t end) {
    std::fill(last_corners_.begin() + static_cast<std::ptrdiff_t>(begin),
              last_corners_.begin() + static_cast<std::ptrdiff_t>(end), kLongAgo);
  });
}

void RunCutter::cut(std::size_t begin, std::size_t end) noexcept {
  if (!last_corners_.empty()) match_corners(begin, end);
  choose_runs(begin, end);
}

void RunCutter::match_corners(std::size_t begin, std::size_t end) noexcept {
  const TriangleIndices* const triangles = mesh_.triangles.data();
  std::uint32_t* const last_corners = last_corners_.data();
  std::uint32_t* corners = &runs_.corners[3 * begin];
  std::uint8_t* way_back = &runs_.way_back[3 * begin];
  for (std::size_t i = begin; i < end; ++i) {
    __builtin_prefetch(&triangles[order_.triangle(std::min(i + 2 * kAhead, end - 1))]);
    const TriangleIndices ahead = triangles[order_.triangle(std::min(i + kAhead, end - 1))];
    for (const std::uint32_t vertex : {ahead.x, ahead.y, ahead.z}) __builtin_prefetch(&last_corners[vertex], 1);
    const TriangleIndices triangle = triangles[order_.triangle(i)];
    const auto match = [&](std::uint32_t k, std::uint32_t vertex) {
      const auto corner = static_cast<std::uint32_t>(3 * i) + k;
      const std::uint32_t back = std::min(corner - last_corners[vertex], kMostBack);
      last_corners[vertex] = corner;
      corners[k] = vertex;
      way_back[k] = static_cast<std::uint8_t>(back);
      return kNewness[k][back];
    };
    const std::uint32_t x = match(0, triangle.x), y = match(1, triangle.y), z = match(2, triangle.z);  // in this order
    newness_[i - begin] = x + y + z;
    corners += 3, way_back += 3;
  }
}

// Chooses runs one after another, each of as many triangles as fit. No run crosses the border of a subtree of the
// codes' radix tree that has at most kSubtree triangles, because the curve may jump there. Keys differ more at the
// borders of a subtree than anywhere inside it.
void RunCutter::choose_runs(std::size_t begin, std::size_t end) noexcept {
  std::uint8_t* const first = &runs_.sizes[begin];
  std::uint32_t& count = runs_.counts[begin / kRunChunk];
  std::uint8_t* next_size = first;
  const std::uint64_t* const sorted = order_.sorted.data();
  const std::uint32_t* newness = newness_.data();
  std::uint64_t before = kBorderOfChunk;
  while (begin < end) {
    std::size_t subtree_end = begin + 1;
    std::uint64_t inside = 0, after = 0;
    for (std::size_t next = begin + 1; next <= std::min(end, begin + kSubtree); ++next) {
      const std::uint64_t border = next < end ? sorted[next - 1] ^ sorted[next] : kBorderOfChunk;
      if (border > inside && before > inside) subtree_end = next, after = border;
      inside = std::max(inside, border);
    }
    before = after;
    while (begin < subtree_end) {
      const std::size_t most = std::min<std::size_t>(kLeafSize, subtree_end - begin);
      std::size_t size = 0;
      std::uint32_t vertex_count = 0;
      for (std::size_t i = 0; i < most; ++i) {
        vertex_count += (newness[i] >> (4 * i)) & 15u;
        size += vertex_count <= kLeafSize;
      }
      *next_size++ = static_cast<std::uint8_t>(size);
      newness += size, begin += size;
    }
  }
  count = static_cast<std::uint32_t>(next_size - first);
}

// Triangle order ------------------------------------------------------------------------------------------------------

namespace {

using Key = std::uint64_t;

// The fourth lanes become 0.
[[nodiscard]] Box4 join(const AlignedVector<Box4>& chunks) noexcept {
  Box4 all = Box4::empty();
  for (const Box4& chunk : chunks) all.grow(chunk);
  return {all.lower.xyz0(), all.upper.xyz0()};
}

[[nodiscard]] float longest_side(const Box4& box) noexcept {
  alignas(16) std::array<float, 4> extent;
  (box.upper * Float4(0.5f) - box.lower * Float4(0.5f)).store(extent.data());  // halves: the whole could overflow
  return std::max({extent[0], extent[1], extent[2]});
}

// The fourth lanes are undefined.
[[nodiscard]] Box4 box_of(TriangleTraits, const Mesh& mesh, std::size_t i) noexcept {
  const TriangleIndices corners = mesh.triangles[i];
  const Vec3f* const positions = mesh.positions.data();
  const Float4 first = load_position(positions + corners.x);
  Box4 box{first, first};
  box.grow(load_position(positions + corners.y));
  box.grow(load_position(positions + corners.z));
  return box;
}

template <class Kind>
[[nodiscard]] Box4 box_of(Kind, const Mesh& mesh, std::size_t i) noexcept {
  const Aabb box = Kind::box(mesh, i);
  return {load_xyz(&box.lower), load_xyz(&box.upper)};
}

[[nodiscard]] Box4 box_around(std::span<const Ball> balls) noexcept {
  Aabb box;
  for (const Ball& ball : balls) box.grow(box_of(ball));
  return {load_xyz(&box.lower), load_xyz(&box.upper)};
}

[[nodiscard]] Box4 box_around(std::span<const Vec3f> positions) noexcept {
  Box4 box = Box4::empty();
  for (const Vec3f& position : positions) box.grow(load_position(&position));
  return box;
}

// Returns the box of all vertices or spheres.
template <class Vertex>
[[nodiscard]] Box4 measure_space(const AlignedVector<Vertex>& all, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<Box4> chunks(chunk_count_of(all.size()));
  for_chunks(pool, all.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    chunks[begin / kItemsBetweenAsking] = box_around(std::span(all).subspan(begin, end - begin));
  });
  return join(chunks);
}

// Writes a key for every primitive, with cells that divide `space`; returns the box of all.
template <class Kind>
[[nodiscard]] Box4 write_keys(Kind kind, const Mesh& mesh, const Box4& space, std::span<Key> keys, ThreadPool& pool,
                              CancelToken& cancel) {
  const MortonGrid grid(space);
  AlignedVector<Box4> chunks(chunk_count_of(keys.size()));
  for_chunks(pool, keys.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 all = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = box_of(kind, mesh, i);
      all.grow(box);
      keys[i] = Key{grid.code(MortonGrid::center(box))} << 32 | i;
    }
    chunks[begin / kItemsBetweenAsking] = all;
  });
  return join(chunks);
}

}  // namespace

TriangleOrder order_triangles(const Mesh& mesh, Scratch& scratch, ThreadPool& pool, CancelToken& cancel) {
  TriangleOrder order;
  const auto keys = scratch.take<Key>(mesh.primitive_count()), second = scratch.take<Key>(mesh.primitive_count());
  with_kind(mesh.kind, [&](auto kind) {
    const Box4 space = measure_space(kind.vertices(mesh), pool, cancel);
    order.bounds = write_keys(kind, mesh, space, keys, pool, cancel);
    // Otherwise, loose vertices far away would leave all triangles in a few cells.
    if (longest_side(order.bounds) < 0.5f * longest_side(space)) {
      static_cast<void>(write_keys(kind, mesh, order.bounds, keys, pool, cancel));
    }
  });
  order.sorted = radix_sort(keys, second, 32, kMortonBits, pool, cancel);
  return order;
}

}  // namespace perfect_bvh
