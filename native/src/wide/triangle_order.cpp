#include "wide/triangle_order.h"

#include <array>
#include <utility>
#include <vector>

#include "builders/morton.h"
#include "builders/radix_sort.h"
#include "core/steps.h"

namespace perfect_bvh {
namespace {

using Key = std::uint64_t;

constexpr std::size_t kChunk = 16384;

[[nodiscard]] std::size_t chunk_count(std::size_t count) noexcept { return (count + kChunk - 1) / kChunk; }

[[nodiscard]] Box4 join(const AlignedVector<Box4>& chunks) noexcept {
  Box4 all = Box4::empty();
  for (const Box4& chunk : chunks) all.grow(chunk);
  return all;
}

[[nodiscard]] float longest_side(const Box4& box) noexcept {
  alignas(16) std::array<float, 4> extent;
  (box.upper * Float4(0.5f) - box.lower * Float4(0.5f)).store(extent.data());  // halves: the whole could overflow
  return std::max({extent[0], extent[1], extent[2]});
}

// Copies the vertices; returns their box.
[[nodiscard]] Box4 widen_vertices(const TriangleMesh& mesh, AlignedVector<Float4>& vertices, ThreadPool& pool,
                                  CancelToken& cancel) {
  vertices.resize(mesh.positions.size());
  AlignedVector<Box4> chunks(chunk_count(vertices.size()));
  for_chunks(pool, vertices.size(), kChunk, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 box = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f p = mesh.positions[i];
      vertices[i] = Float4(p.x, p.y, p.z, 0.0f);
      box.grow(vertices[i]);
    }
    chunks[begin / kChunk] = box;
  });
  return join(chunks);
}

// Writes a key for every triangle, with cells that divide `space`; returns the triangles' box.
[[nodiscard]] Box4 write_keys(const TriangleMesh& mesh, const AlignedVector<Float4>& vertices, const Box4& space,
                              AlignedVector<Key>& keys, ThreadPool& pool, CancelToken& cancel) {
  const MortonGrid grid(space);
  AlignedVector<Box4> chunks(chunk_count(keys.size()));
  for_chunks(pool, keys.size(), kChunk, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 all = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) {
      const TriangleIndices corners = mesh.triangles[i];
      Box4 box{vertices[corners.x], vertices[corners.x]};
      box.grow(vertices[corners.y]);
      box.grow(vertices[corners.z]);
      all.grow(box);
      keys[i] = Key{grid.code(MortonGrid::center(box))} << 32 | i;
    }
    chunks[begin / kChunk] = all;
  });
  return join(chunks);
}

}  // namespace

TriangleOrder order_triangles(const TriangleMesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  TriangleOrder order;
  const Box4 space = widen_vertices(mesh, order.vertices, pool, cancel);
  AlignedVector<Key> keys(mesh.triangle_count()), scratch(mesh.triangle_count());
  order.bounds = write_keys(mesh, order.vertices, space, keys, pool, cancel);
  // Loose vertices far away would leave all triangles in a few cells.
  if (longest_side(order.bounds) < 0.5f * longest_side(space)) {
    static_cast<void>(write_keys(mesh, order.vertices, order.bounds, keys, pool, cancel));
  }
  const bool is_in_scratch = radix_sort(keys, scratch, 32, kMortonBits, pool, cancel).data() == scratch.data();
  order.sorted = std::move(is_in_scratch ? scratch : keys);
  return order;
}

}  // namespace perfect_bvh
