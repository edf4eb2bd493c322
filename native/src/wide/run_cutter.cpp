#include "wide/run_cutter.h"

#include <algorithm>
#include <array>

#include "core/steps.h"

namespace perfect_bvh {
namespace {

constexpr std::uint32_t kLongAgo = ~0u - 2 * kMostBack;  // before corner 0
constexpr std::size_t kAhead = 16;                       // triangles fetched before they are needed

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

RunCutter::RunCutter(const TriangleMesh& mesh, const TriangleOrder& order, TreeLayout layout, CancelToken& cancel)
    : mesh_(mesh),
      order_(order),
      limits_vertices_(layout == TreeLayout::kDefault),
      last_corner_(limits_vertices_ ? mesh.positions.size() : 0),
      newness_(kRunChunk, 0u) {
  for_steps(last_corner_.size(), cancel, [&](std::size_t begin, std::size_t end) {
    std::fill(last_corner_.data() + begin, last_corner_.data() + end, kLongAgo);
  });
}

void RunCutter::cut(std::size_t begin, std::size_t end, RunChunk& chunk) {
  if (limits_vertices_) match_corners(begin, end, chunk);
  choose_runs(begin, end, chunk);
}

void RunCutter::match_corners(std::size_t begin, std::size_t end, RunChunk& chunk) {
  chunk.corners.resize(3 * (end - begin));
  chunk.way_back.resize(3 * (end - begin));
  for (std::size_t i = begin; i < end; ++i) {
    if (i + kAhead < end) __builtin_prefetch(&mesh_.triangles[order_.triangle(i + kAhead)]);
    const TriangleIndices triangle = mesh_.triangles[order_.triangle(i)];
    const std::array<std::uint32_t, 3> vertices{triangle.x, triangle.y, triangle.z};
    std::uint32_t newness = 0;
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto corner = static_cast<std::uint32_t>(3 * i + k);
      const std::uint32_t back = std::min(corner - last_corner_[vertices[k]], kMostBack);
      last_corner_[vertices[k]] = corner;
      chunk.corners[3 * (i - begin) + k] = vertices[k];
      chunk.way_back[3 * (i - begin) + k] = static_cast<std::uint8_t>(back);
      newness += kNewness[k][back];
    }
    newness_[i - begin] = newness;
  }
}

// Keys differ most at the borders of a subtree: more than anywhere inside it.
void RunCutter::choose_runs(std::size_t begin, std::size_t end, RunChunk& chunk) const {
  chunk.sizes.reserve((end - begin) / 2);
  constexpr std::uint64_t kBorderOfChunk = ~std::uint64_t{0};
  std::uint64_t before = kBorderOfChunk;
  while (begin < end) {
    const std::uint32_t* const newness = &newness_[begin % kRunChunk];
    const std::size_t most = std::min<std::size_t>(kLeafSize, end - begin);
    std::size_t size = 1;
    std::uint32_t vertex_count = 0;
    std::uint64_t inside = 0, after = 0;
    for (std::size_t i = 0; i < most; ++i) {
      vertex_count += (newness[i] >> (4 * i)) & 15u;
      if (vertex_count > kLeafSize) break;
      const std::size_t next = begin + i + 1;
      const std::uint64_t border = next < end ? order_.sorted[next - 1] ^ order_.sorted[next] : kBorderOfChunk;
      if (border > inside && before > inside) size = i + 1, after = border;
      inside = std::max(inside, border);
    }
    chunk.sizes.push_back(static_cast<std::uint8_t>(size));
    begin += size;
    before = after;
  }
}

}  // namespace perfect_bvh
