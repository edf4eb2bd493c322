// The references a top-down builder works on: its own copy, a second array to partition into, and the root's range.
// In: the caller's references. Out: the same with every zero positive, since -0 and +0 are equal and which of them a
// minimum keeps would otherwise depend on the order of the threads.
#pragma once

#include <span>

#include "build/prim_ref.h"
#include "build/top_down.h"
#include "core/aligned.h"
#include "core/thread_pool.h"

namespace perfect_bvh {

struct WorkingRefs {
  AlignedVector<PrimRef> refs;
  AlignedVector<PrimRef> scratch;
  BuildRange root;

  WorkingRefs(std::span<const PrimRef> prims, ThreadPool& pool);

  [[nodiscard]] const PrimRef* rows(const BuildRange& range) const noexcept {
    return (range.in_scratch ? scratch : refs).data() + range.begin;
  }
};

// Twice the centre of a reference's box; the fourth lane is any number.
[[nodiscard]] inline Float4 doubled_centroid(const Box4& box) noexcept {
  return box.lower + box.upper;
}

// The box of `count` references and that of their doubled centroids.
void measure(const PrimRef* refs, std::size_t count, Box4& box, Box4& centroids) noexcept;

// What brings extents near 1, so that no area over- or underflows.
[[nodiscard]] float area_scale(const Box4& root) noexcept;

// Splits a range in halves, sorted along the axis on which the centroids spread most: what is left to do where the SAH
// says nothing (all centroids equal, no area) or the depth runs out.
void split_in_halves(const BuildRange& range, PrimRef* rows, BuildRange& left, BuildRange& right);

}  // namespace perfect_bvh
