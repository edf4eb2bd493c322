#include "wide/triangle_order.h"

#include <algorithm>
#include <array>

#include "builders/morton.h"
#include "builders/radix_sort.h"
#include "core/aligned.h"
#include "core/steps.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
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

// With fourth lanes that mean nothing.
[[nodiscard]] Box4 box_of_triangle(const Mesh& mesh, std::size_t i) noexcept {
  const TriangleIndices corners = mesh.triangles[i];
  const Vec3f* const positions = mesh.positions.data();
  const Float4 first = load_position(positions + corners.x);
  Box4 box{first, first};
  box.grow(load_position(positions + corners.y));
  box.grow(load_position(positions + corners.z));
  return box;
}

[[nodiscard]] Box4 box_of_round(const Mesh& mesh, std::size_t i) noexcept {
  const Aabb box = mesh.primitive_box(i);
  return {load_xyz(&box.lower), load_xyz(&box.upper)};
}

// Of all balls.
[[nodiscard]] Box4 measure_round_space(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<Box4> chunks(chunk_count_of(mesh.balls.size()));
  for_chunks(pool, mesh.balls.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    Aabb all;
    for (std::size_t i = begin; i < end; ++i) all.grow(box_of(mesh.balls[i]));
    chunks[begin / kItemsBetweenAsking] = {load_xyz(&all.lower), load_xyz(&all.upper)};
  });
  return join(chunks);
}

// Of all vertices.
[[nodiscard]] Box4 measure_space(const Mesh& mesh, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<Box4> chunks(chunk_count_of(mesh.positions.size()));
  for_chunks(pool, mesh.positions.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 box = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) box.grow(load_position(&mesh.positions[i]));
    chunks[begin / kItemsBetweenAsking] = box;
  });
  return join(chunks);
}

// Writes a key for every primitive, with cells that divide `space`; returns the box of all. box_at: of a primitive.
template <Box4 (*box_at)(const Mesh&, std::size_t) noexcept>
[[nodiscard]] Box4 write_keys(const Mesh& mesh, const Box4& space, std::span<Key> keys, ThreadPool& pool,
                              CancelToken& cancel) {
  const MortonGrid grid(space);
  AlignedVector<Box4> chunks(chunk_count_of(keys.size()));
  for_chunks(pool, keys.size(), kItemsBetweenAsking, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 all = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = box_at(mesh, i);
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
  const Box4 space = mesh.is_round() ? measure_round_space(mesh, pool, cancel) : measure_space(mesh, pool, cancel);
  const auto write = mesh.is_round() ? write_keys<box_of_round> : write_keys<box_of_triangle>;
  const auto keys = scratch.take<Key>(mesh.primitive_count()), second = scratch.take<Key>(mesh.primitive_count());
  order.bounds = write(mesh, space, keys, pool, cancel);
  // Loose vertices far away would leave all triangles in a few cells.
  if (longest_side(order.bounds) < 0.5f * longest_side(space)) {
    static_cast<void>(write(mesh, order.bounds, keys, pool, cancel));
  }
  order.sorted = radix_sort(keys, second, 32, kMortonBits, pool, cancel);
  return order;
}

}  // namespace perfect_bvh
