#include "builders/morton_clusters.h"

#include <algorithm>
#include <array>
#include <vector>

#include "builders/morton.h"
#include "builders/radix_sort.h"
#include "core/steps.h"
#include "math/float4.h"

namespace perfect_bvh {
namespace {

using Key = std::uint64_t;  // Morton code, then the reference's position: no two are equal

constexpr std::size_t kChunk = 16384;  // references a thread takes at a time; no cluster spans two chunks

// How large a cluster's box may be, as a multiple of its members' boxes together. A looser one misleads a
// builder that sees only the cluster's box: long thin triangles, or a large one among small ones.
constexpr float kLooseness = 1.0f;

[[nodiscard]] std::size_t chunk_count(std::size_t count) noexcept { return (count + kChunk - 1) / kChunk; }

[[nodiscard]] Box4 measure_centers(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel) {
  AlignedVector<Box4> chunks(chunk_count(prims.size()));
  for_chunks(pool, prims.size(), kChunk, cancel, [&](std::size_t begin, std::size_t end) {
    Box4 centers = Box4::empty();
    for (std::size_t i = begin; i < end; ++i) centers.grow(MortonGrid::center(Box4::load(&prims[i])));
    chunks[begin / kChunk] = centers;
  });
  Box4 all = Box4::empty();
  for (const Box4& chunk : chunks) all.grow(chunk);
  return all;
}

// Cuts rows [begin, end) of a chunk into clusters.
class ClusterCutter {
 public:
  ClusterCutter(std::span<const Key> keys, std::span<const PrimRef> prims, std::vector<PrimRef>& boxes,
                std::vector<ClusterRows>& rows) noexcept
      : keys_(keys), prims_(prims), boxes_(boxes), rows_(rows) {}

  void cut(std::size_t begin, std::size_t end) {
    Key before = ~Key{0};
    while (begin < end) {
      const std::size_t next = end_of_subtree(begin, end, before);
      if (next < end) before = keys_[next - 1] ^ keys_[next];
      add(begin, next);
      begin = next;
    }
  }

 private:
  // Of the largest subtree of the radix tree that starts at `begin` and has at most kMaxClusterSize members. Keys
  // differ most at the borders of a subtree; `before` is the difference at its first.
  [[nodiscard]] std::size_t end_of_subtree(std::size_t begin, std::size_t end, Key before) const noexcept {
    std::size_t result = begin + 1;
    Key inside = 0;
    for (std::size_t next = begin + 1; next <= end && next <= begin + kMaxClusterSize; ++next) {
      const Key border = next < end ? keys_[next - 1] ^ keys_[next] : ~Key{0};
      if (border > inside && before > inside) result = next;
      inside = std::max(inside, border);
    }
    return result;
  }

  void add(std::size_t begin, std::size_t end) {
    Box4 box = Box4::empty();
    float area = 0.0f;
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 member = Box4::load(&prims_[i]);
      box.grow(member);
      area += half_area(member.extent());
    }
    if (end - begin > 1 && !(half_area(box.extent()) <= kLooseness * area)) {
      const std::size_t middle = widest_gap(begin, end);
      add(begin, middle);
      return add(middle, end);
    }
    PrimRef ref;
    box.lower.store(&ref.lower);
    box.upper.store(&ref.upper);
    ref.prim_index = static_cast<std::uint32_t>(boxes_.size());
    ref.unused = 0;
    boxes_.push_back(ref);
    rows_.push_back({static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end - begin)});
  }

  // Where the radix tree splits these rows.
  [[nodiscard]] std::size_t widest_gap(std::size_t begin, std::size_t end) const noexcept {
    std::size_t result = begin + 1;
    for (std::size_t i = begin + 2; i < end; ++i) {
      if ((keys_[i - 1] ^ keys_[i]) > (keys_[result - 1] ^ keys_[result])) result = i;
    }
    return result;
  }

  std::span<const Key> keys_;
  std::span<const PrimRef> prims_;
  std::vector<PrimRef>& boxes_;
  std::vector<ClusterRows>& rows_;
};

struct ChunkClusters {
  std::vector<PrimRef> boxes;
  std::vector<ClusterRows> rows;
};

// Strings the chunks' clusters together.
void join(const std::vector<ChunkClusters>& chunks, MortonClusters& result, CancelToken& cancel) {
  std::size_t count = 0;
  for (const ChunkClusters& chunk : chunks) count += chunk.boxes.size();
  result.boxes.resize(count);
  result.rows.resize(count);
  std::uint32_t next = 0;
  for (const ChunkClusters& chunk : chunks) {
    cancel.checkpoint();
    for (std::size_t i = 0; i < chunk.boxes.size(); ++i, ++next) {
      result.boxes[next] = chunk.boxes[i];
      result.boxes[next].prim_index = next;
      result.rows[next] = chunk.rows[i];
    }
  }
}

}  // namespace

MortonClusters make_morton_clusters(std::span<const PrimRef> prims, ThreadPool& pool, CancelToken& cancel) {
  const MortonGrid grid(measure_centers(prims, pool, cancel));
  AlignedVector<Key> keys(prims.size()), scratch(prims.size());
  for_chunks(pool, prims.size(), kChunk, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      keys[i] = Key{grid.code(MortonGrid::center(Box4::load(&prims[i])))} << 32 | i;
    }
  });
  const std::span<const Key> sorted = radix_sort(keys, scratch, 32, kMortonBits, pool, cancel);
  MortonClusters result;
  result.prims.resize(prims.size());
  std::vector<ChunkClusters> chunks(chunk_count(prims.size()));
  for_chunks(pool, prims.size(), kChunk, cancel, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) result.prims[i] = prims[static_cast<std::uint32_t>(sorted[i])];
    ChunkClusters& chunk = chunks[begin / kChunk];
    chunk.boxes.reserve(end - begin);
    chunk.rows.reserve(end - begin);
    ClusterCutter(sorted, result.prims, chunk.boxes, chunk.rows).cut(begin, end);
  });
  join(chunks, result, cancel);
  return result;
}

}  // namespace perfect_bvh
