#include "build/working_refs.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

namespace perfect_bvh {
namespace {

constexpr std::size_t kChunk = 16384;

Box4 copy_positive_zeros(const PrimRef& from, PrimRef& to) noexcept {
  const Float4 zero(0.0f);
  const Box4 box = Box4::load(&from);
  const Box4 positive{box.lower + zero, box.upper + zero};
  positive.lower.store(&to.lower);
  positive.upper.store(&to.upper);
  to.prim_index = from.prim_index;
  to.unused = 0;
  return positive;
}

std::array<float, 4> lanes(Float4 v) noexcept {
  alignas(16) std::array<float, 4> result;
  v.store(result.data());
  return result;
}

}  // namespace

WorkingRefs::WorkingRefs(std::span<const PrimRef> prims, ThreadPool& pool) {
  refs.resize(prims.size());
  scratch.resize(prims.size());
  struct Bounds {
    Box4 box = Box4::empty();
    Box4 centroids = Box4::empty();
  };
  AlignedVector<Bounds> chunks((prims.size() + kChunk - 1) / kChunk);
  parallel_for(pool, prims.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    Bounds bounds;
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = copy_positive_zeros(prims[i], refs[i]);
      bounds.box.grow(box);
      bounds.centroids.grow(doubled_centroid(box));
    }
    chunks[begin / kChunk] = bounds;
  });
  Bounds all;
  for (const Bounds& chunk : chunks)
    all.box.grow(chunk.box), all.centroids.grow(chunk.centroids);
  root = {all.box, all.centroids, 0, static_cast<std::uint32_t>(prims.size()), 0, false};
}

void measure(const PrimRef* refs, std::size_t count, Box4& box, Box4& centroids) noexcept {
  box = centroids = Box4::empty();
  for (std::size_t i = 0; i < count; ++i) {
    const Box4 ref = Box4::load(&refs[i]);
    box.grow(ref);
    centroids.grow(doubled_centroid(ref));
  }
}

float area_scale(const Box4& root) noexcept {
  const auto extent = lanes(root.extent());
  const float largest = std::max({extent[0], extent[1], extent[2]});
  constexpr float kMax = std::numeric_limits<float>::max();
  return std::min(1.0f / std::max(largest, 1.0f / kMax), kMax);
}

void split_in_halves(const BuildRange& range, PrimRef* rows, BuildRange& left, BuildRange& right) {
  const auto spread = lanes(range.centroids.extent());
  const int axis = spread[0] >= spread[1] && spread[0] >= spread[2] ? 0 : spread[1] >= spread[2] ? 1 : 2;
  const std::uint32_t half = range.count / 2;
  if (spread[static_cast<std::size_t>(axis)] > 0.0f) {
    std::nth_element(rows, rows + half, rows + range.count, [axis](const PrimRef& a, const PrimRef& b) {
      const float at = a.lower[axis] + a.upper[axis];
      const float bt = b.lower[axis] + b.upper[axis];
      return at != bt ? at < bt : a.prim_index < b.prim_index;
    });
  }
  left = {{}, {}, range.begin, half, range.depth + 1, range.in_scratch};
  right = {{}, {}, range.begin + half, range.count - half, range.depth + 1, range.in_scratch};
  measure(rows, half, left.box, left.centroids);
  measure(rows + half, right.count, right.box, right.centroids);
}

}  // namespace perfect_bvh
