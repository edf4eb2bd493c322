#include "query/intersections.h"

#include <algorithm>
#include <array>
#include <limits>

#include "core/aligned.h"
#include "core/errors.h"
#include "tlas/trace_view.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kUsualHits = 4 * kBlockRays;

// Calls take(row, hits) with all that each ray meets, unsorted and with repetitions. `room` grows to the most that one
// ray needs.
template <class Take>
void for_each_ray(const Snapshot& snapshot, std::span<const Ray> rays, Cull cull, AlignedVector<FoundHit>& room,
                  CancelToken& cancel, Take&& take) {
  std::array<std::size_t, kBlockRays> counts;
  for (std::size_t done = 0; done < rays.size();) {
    const RayBatch batch{rays.data() + done, rays.size() - done, cull};
    std::size_t finished = 0;
    with_view(snapshot, cancel, [&](const SceneView& view) {
      finished = find_all_hits(view, batch, {room.data(), room.size(), counts.data()});
    });
    if (finished == 0) room.resize(std::max(counts[0], kUsualHits));
    std::size_t first = 0;
    for (std::size_t i = 0; i < finished; ++i) {
      take(done + i, std::span(room.data() + first, counts[i]));
      first += counts[i];
    }
    done += finished;
  }
}

// One ray may have millions of hits: `cancel` is asked while they are sorted and stored, too.
constexpr std::size_t kHitsBetweenAsking = std::size_t{1} << 16;

struct Nearer {
  const Snapshot& snapshot;
  CancelToken& cancel;
  std::size_t& comparison_count;
  bool operator()(const FoundHit& a, const FoundHit& b) const {
    if (++comparison_count % kHitsBetweenAsking == 0) cancel.checkpoint();
    if (a.t != b.t) return a.t < b.t;
    if (a.instance_index == b.instance_index) {
      return a.primitive_index != b.primitive_index ? a.primitive_index < b.primitive_index : a.v < b.v;
    }
    const Instance &first = snapshot.instances[a.instance_index], &second = snapshot.instances[b.instance_index];
    return first.order != second.order ? first.order < second.order : first.id < second.id;
  }
};

bool is_round(const FoundHit& hit, const Snapshot& snapshot) {
  return snapshot.instance_views[hit.instance_index].is_round != 0;
}

// A triangle's t depends on ray and instance only, so its repetitions end up side by side; so do those of either end of
// the ray's way through a curve or point, which v tells apart.
std::span<FoundHit> sort_once_each(std::span<FoundHit> hits, const Snapshot& snapshot, CancelToken& cancel) {
  std::size_t comparison_count = 0;
  std::sort(hits.begin(), hits.end(), Nearer{snapshot, cancel, comparison_count});
  const auto same = [&](const FoundHit& a, const FoundHit& b) {
    return a.instance_index == b.instance_index && a.primitive_index == b.primitive_index &&
           (a.v == b.v || !is_round(a, snapshot));
  };
  return hits.first(static_cast<std::size_t>(std::unique(hits.begin(), hits.end(), same) - hits.begin()));
}

std::int32_t to_count(std::size_t count) {
  return static_cast<std::int32_t>(std::min<std::size_t>(count, std::numeric_limits<std::int32_t>::max()));
}

}  // namespace

std::size_t count_intersections(const Snapshot& snapshot, const RayColumns& columns, std::int32_t* counts,
                                ThreadPool& pool, int max_threads, CancelToken& cancel) {
  return for_each_block(columns, pool, max_threads, cancel, [&](std::span<const Ray> rays, std::size_t first) {
    count_rays(snapshot, rays.size());
    std::array<std::size_t, kBlockRays> found;
    bool repeats = false;
    with_view(snapshot, cancel, [&](const SceneView& view) {
      repeats = view.repeats_triangles;
      if (repeats) return;
      static_cast<void>(find_all_hits(view, {rays.data(), rays.size(), columns.cull}, {nullptr, 0, found.data()}));
    });
    if (repeats) {
      AlignedVector<FoundHit> room(kUsualHits);
      for_each_ray(snapshot, rays, columns.cull, room, cancel, [&](std::size_t row, std::span<FoundHit> hits) {
        counts[first + row] = to_count(sort_once_each(hits, snapshot, cancel).size());
      });
      return;
    }
    std::transform(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(rays.size()), counts + first, to_count);
  });
}

std::size_t list_intersections(const Snapshot& snapshot, const RayColumns& columns,
                               std::span<const std::int64_t> splits, const HitColumns& out, ThreadPool& pool,
                               int max_threads, CancelToken& cancel) {
  return for_each_block(columns, pool, max_threads, cancel, [&](std::span<const Ray> rays, std::size_t first) {
    count_rays(snapshot, rays.size());
    AlignedVector<FoundHit> room(kUsualHits);
    for_each_ray(snapshot, rays, columns.cull, room, cancel, [&](std::size_t row, std::span<FoundHit> found) {
      const std::span<FoundHit> sorted = sort_once_each(found, snapshot, cancel);
      const auto begin = static_cast<std::size_t>(splits[first + row]);
      const std::size_t wanted = static_cast<std::size_t>(splits[first + row + 1]) - begin;
      if (wanted > sorted.size()) throw EngineError("list_intersections: ray_splits leave room for more than there is");
      for (std::size_t i = 0; i < wanted; ++i) {
        if (i % kHitsBetweenAsking == kHitsBetweenAsking - 1) cancel.checkpoint();
        const FoundHit& hit = sorted[i];
        const Hit narrowed{static_cast<float>(hit.t) + 0.0f, hit.u, hit.v, hit.instance_index, hit.primitive_index};
        store_hits(out, begin + i, snapshot, {&narrowed, 1}, rays.subspan(row, 1));
      }
    });
  });
}

}  // namespace perfect_bvh
