#include "wide/morton_leaves.h"

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <vector>

#include "core/errors.h"
#include "core/steps.h"
#include "wide/leaf_block.h"
#include "wide/run_cutter.h"
#include "wide/triangle_order.h"
#include "wide/wide_boxes.h"

namespace perfect_bvh {
namespace {

// A run's vertices: each once, and every corner's place among them. Where a corner's vertex occurred before, the
// cutter has noted.
struct RunVertices {
  std::array<std::uint32_t, 9> vertices;
  std::uint32_t count = 0;
  std::array<std::uint32_t, kLeafSize> corners;

  RunVertices(const std::uint32_t* corner_vertices, const std::uint8_t* way_back, std::uint32_t size) noexcept {
    std::array<std::uint8_t, kMostBack + 3 * kLeafSize> places_of;
    std::uint8_t* const place_of = places_of.data() + kMostBack;  // what lies before it is read, but not used
    for (std::uint32_t triangle = 0; triangle < size; ++triangle) {
      std::uint32_t word = 0;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t corner = 3 * triangle + k;
        const bool is_new = way_back[corner] > corner;
        const std::uint32_t place = is_new ? count : place_of[static_cast<int>(corner) - way_back[corner]];
        place_of[corner] = static_cast<std::uint8_t>(place);
        vertices[place] = corner_vertices[corner];
        count += is_new;
        word |= place << (4 * k);
      }
      corners[triangle] = word;
    }
    std::fill(vertices.begin() + count, vertices.end(), vertices[count - 1]);
  }
};

// Rows of the block in the order of the triangles' numbers.
void write_triangles(LeafBlock& block, const TriangleOrder& order, std::size_t first, std::uint32_t size,
                     const std::array<std::uint32_t, kLeafSize>& corners) noexcept {
  std::array<std::int32_t, kLeafSize> numbers, ranks{};  // signed: compared by SSE2
  numbers.fill(std::numeric_limits<std::int32_t>::max());
  for (std::uint32_t i = 0; i < size; ++i) numbers[i] = static_cast<std::int32_t>(order.triangle(first + i));
  for (const std::int32_t number : numbers) {
    for (std::uint32_t i = 0; i < kLeafSize; ++i) ranks[i] += numbers[i] > number;
  }
  for (std::uint32_t i = 0; i < size; ++i) {
    block.primitives[ranks[i]] = static_cast<std::uint32_t>(numbers[i]);
    block.corners[ranks[i]] = corners[i];
  }
  std::fill(block.primitives + size, block.primitives + kLeafSize, block.primitives[size - 1]);
  std::fill(block.corners + size, block.corners + kLeafSize, block.corners[size - 1]);
}

[[nodiscard]] Box4 write_vertices(LeafBlock& block, const TriangleOrder& order, const RunVertices& run,
                                  Float4 scale) noexcept {
  std::array<Float4, 8> rows;
  for (std::size_t i = 0; i < 8; ++i) rows[i] = order.vertices[run.vertices[i]] * scale;
  Box4 box{rows[0], rows[0]};
  for (std::size_t i = 1; i < 8; ++i) box.grow(rows[i]);
  transpose(rows[0], rows[1], rows[2], rows[3]);
  transpose(rows[4], rows[5], rows[6], rows[7]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    rows[axis].store(&block.vertices[axis][0]);
    rows[axis + 4].store(&block.vertices[axis][4]);
  }
  const Float4 zero(0.0f);  // -0 + 0 is 0: a box is the same whichever of its zeros came first
  box.lower = box.lower + zero, box.upper = box.upper + zero;
  return box;
}

// In as many parts as there are threads: each needs a memory of all vertices.
void cut_chunks(const TriangleMesh& mesh, const TriangleOrder& order, TreeLayout layout, std::vector<RunChunk>& chunks,
                ThreadPool& pool, CancelToken& cancel) {
  const auto threads = static_cast<std::size_t>(pool.thread_count());
  const std::size_t part = (chunks.size() + threads - 1) / threads;
  for_chunks(pool, chunks.size(), part, cancel, [&](std::size_t begin, std::size_t end) {
    RunCutter cutter(mesh, order, layout, cancel);
    for (std::size_t i = begin; i < end; ++i) {
      cancel.checkpoint();
      cutter.cut(i * kRunChunk, std::min(mesh.triangle_count(), (i + 1) * kRunChunk), chunks[i]);
    }
  });
}

// The blocks of a chunk whose first triangle stands in place `begin`, from row `row` on.
void fill_blocks(const TriangleOrder& order, std::size_t begin, const RunChunk& chunk, std::size_t row,
                 MortonLeaves& leaves) noexcept {
  const Float4 scale(leaves.scale);
  std::size_t done = 0;
  for (const std::uint8_t size : chunk.sizes) {
    LeafBlock& block = leaves.blocks[row];
    const RunVertices run(chunk.corners.data() + 3 * done, chunk.way_back.data() + 3 * done, size);
    write_triangles(block, order, begin + done, size, run.corners);
    leaves.boxes[row] = make_cluster(write_vertices(block, order, run, scale), order.code(begin + done),
                                     order.code(begin + done + size - 1));
    done += size;
    ++row;
  }
}

// The same for the compact layout.
void fill_indexed_leaves(const TriangleMesh& mesh, const TriangleOrder& order, std::size_t begin, const RunChunk& chunk,
                         std::size_t row, MortonLeaves& leaves) noexcept {
  constexpr std::size_t kAhead = 16;  // triangles fetched before they are needed
  const Float4 scale(leaves.scale), zero(0.0f);
  const std::size_t last = order.sorted.size() - 1;
  for (const std::uint8_t size : chunk.sizes) {
    std::array<std::uint32_t, kLeafSize> numbers;
    Box4 box = Box4::empty();
    for (std::size_t i = 0; i < size; ++i) {
      __builtin_prefetch(&mesh.triangles[order.triangle(std::min(begin + i + kAhead, last))]);
      numbers[i] = order.triangle(begin + i);
      const TriangleIndices corners = mesh.triangles[numbers[i]];
      for (const std::uint32_t vertex : {corners.x, corners.y, corners.z}) box.grow(order.vertices[vertex] * scale);
    }
    leaves.indexed_leaves[row] = make_indexed_leaf(numbers.data(), size);
    box.lower = box.lower + zero, box.upper = box.upper + zero;
    leaves.boxes[row++] = make_cluster(box, order.code(begin), order.code(begin + size - 1));
    begin += size;
  }
}

}  // namespace

MortonLeaves make_morton_leaves(const TriangleMesh& mesh, TreeLayout layout, ThreadPool& pool, CancelToken& cancel) {
  const std::size_t count = mesh.triangle_count();
  if (count > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw EngineError("the mesh has more triangles than a tree can refer to");
  }
  const TriangleOrder order = order_triangles(mesh, pool, cancel);
  MortonLeaves leaves;
  leaves.bounds = to_aabb(order.bounds);
  leaves.scale = tree_scale(leaves.bounds);

  std::vector<RunChunk> chunks((count + kRunChunk - 1) / kRunChunk);
  cut_chunks(mesh, order, layout, chunks, pool, cancel);
  std::vector<std::size_t> first_leaves(chunks.size() + 1);
  for (std::size_t i = 0; i < chunks.size(); ++i) first_leaves[i + 1] = first_leaves[i] + chunks[i].sizes.size();
  if (first_leaves.back() > kMostBlocks) throw EngineError("the mesh has more leaves than a tree can refer to");
  const bool is_compact = layout == TreeLayout::kCompact;
  leaves.blocks.resize(is_compact ? 0 : first_leaves.back());
  leaves.indexed_leaves.resize(is_compact ? first_leaves.back() : 0);
  leaves.boxes.reserve(most_clusters(first_leaves.back()));
  leaves.boxes.resize(first_leaves.back());
  for_chunks(pool, count, kRunChunk, cancel, [&](std::size_t begin, std::size_t end) {
    RunChunk& chunk = chunks[begin / kRunChunk];
    const std::size_t row = first_leaves[begin / kRunChunk];
    if (is_compact) {
      fill_indexed_leaves(mesh, order, begin, chunk, row, leaves);
    } else {
      fill_blocks(order, begin, chunk, row, leaves);
    }
    chunk = {};
    cancel.advance(2 * (end - begin));  // what is left takes little: there is no binary tree
  });
  return leaves;
}

}  // namespace perfect_bvh
