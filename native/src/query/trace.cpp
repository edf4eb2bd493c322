#include "query/trace.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/aligned.h"
#include "core/errors.h"
#include "tlas/assemble.h"
#include "traverse/dispatch.h"

namespace perfect_bvh {
namespace {

// Origins or directions, with a stride.
template <class T>
struct Vectors {
  const T* numbers;
  std::ptrdiff_t stride;

  Vectors(const Vec3<T>* first, std::ptrdiff_t the_stride) noexcept
      : numbers(reinterpret_cast<const T*>(first)), stride(the_stride) {}
  [[nodiscard]] Vec3d operator[](std::size_t row) const noexcept {
    const T* const at = numbers + static_cast<std::ptrdiff_t>(row) * stride;
    return {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
  }
};

// Equals is_valid, in half of its steps: x - x is zero unless x is not finite.
inline bool can_hit(Vec3d o, Vec3d d, float t_min, float t_max) noexcept {
  const Vec3d zeros = (o - o) + (d - d);
  const double length = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  return (zeros.x + zeros.y + zeros.z == 0.0) & (length > 0.0) & (t_min <= t_max);
}

// Sets components to zero that are tiny compared with the longest one. Products of three such components could
// underflow a double (math/exact_edges.h), and answers would depend on their rounding. No float is affected.
Vec3d without_traces(Vec3d d) noexcept {
  const double least = 0x1p-300 * std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  const auto kept = [least](double x) { return std::abs(x) < least ? std::copysign(0.0, x) : x; };
  return {kept(d.x), kept(d.y), kept(d.z)};
}

template <class Origin, class Direction>
std::size_t load(const RayColumns& columns, Vectors<Origin> origins, Vectors<Direction> directions, std::size_t first,
                 std::span<Ray> rays) noexcept {
  std::size_t valid = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const std::size_t row = first + i;
    const Vec3d origin = origins[row], given = directions[row];
    const Vec3d direction = std::is_same_v<Direction, double> ? without_traces(given) : given;
    const float t_min = columns.t_min[row * columns.t_min_stride], time = columns.times[row * columns.time_stride];
    // A ray with an invalid time must hit nothing: it gets an empty range.
    constexpr float kNoRange = std::numeric_limits<float>::quiet_NaN();
    const float t_max = is_in_shutter(time) ? columns.t_max[row * columns.t_max_stride] : kNoRange;
    valid += static_cast<std::size_t>(can_hit(origin, direction, t_min, t_max));
    rays[i].origin = origin;
    rays[i].direction = direction;
    rays[i].t_min = t_min;
    rays[i].t_max = t_max;
    rays[i].mask = columns.masks[row * columns.mask_stride];
    rays[i].time = time;
  }
  return rays.size() - valid;
}

template <class Origin>
std::size_t load_from(const RayColumns& columns, const Vec3<Origin>* origins, std::size_t first,
                      std::span<Ray> rays) noexcept {
  const Vectors<Origin> starts(origins, columns.origin_stride);
  if (columns.directions_double) {
    return load(columns, starts, Vectors<double>(columns.directions_double, columns.direction_stride), first, rays);
  }
  return load(columns, starts, Vectors<float>(columns.directions_float, columns.direction_stride), first, rays);
}

}  // namespace

std::size_t load_rays(const RayColumns& columns, std::size_t first, std::span<Ray> rays) noexcept {
  if (columns.origins_double) {
    return load_from(columns, columns.origins_double, first, rays);
  }
  return load_from(columns, columns.origins_float, first, rays);
}

// Ray batch -----------------------------------------------------------------------------------------------------------

namespace {

std::size_t block_rays(const RayColumns& columns) {
  return columns.strategy == Strategy::kAuto ? large_block_rays(columns.count) : kBlockRays;
}

}  // namespace

BatchSummary cast_rays(const Snapshot& snapshot, const RayColumns& columns, const HitColumns& out, ThreadPool& pool,
                       int max_threads, CancelToken& cancel) {
  std::atomic<std::size_t> packet_count{0};
  const auto trace = [&](std::span<const Ray> rays, std::size_t first) {
    KeptByThread<AlignedVector<Hit>> kept_hits;
    KeptByThread<AlignedVector<RayCounts>> kept_counts;
    const std::span<Hit> hits = room_for(*kept_hits, rays.size());
    const std::span<RayCounts> counts = room_for(*kept_counts, out.want_counts() ? rays.size() : 0);
    packet_count.fetch_add(trace_closest(snapshot, cancel, rays, hits, columns.cull, counts, columns.strategy),
                           std::memory_order_relaxed);
    store_hits(out, first, snapshot, hits, rays);
    store_counts(out, first, counts);
  };
  const std::size_t invalid_count = for_each_block(columns, pool, max_threads, cancel, trace, block_rays(columns));
  return {invalid_count, packet_count.load()};
}

std::size_t test_occlusions(const Snapshot& snapshot, const RayColumns& columns, std::uint8_t* occluded,
                            ThreadPool& pool, int max_threads, CancelToken& cancel) {
  const auto trace = [&](std::span<const Ray> rays, std::size_t first) {
    trace_occluded(snapshot, cancel, rays, std::span(occluded + first, rays.size()), columns.cull, {},
                   columns.strategy);
  };
  return for_each_block(columns, pool, max_threads, cancel, trace, block_rays(columns));
}

// Trace ---------------------------------------------------------------------------------------------------------------

namespace {

Vec3d absolute(Vec3d a) noexcept { return {std::abs(a.x), std::abs(a.y), std::abs(a.z)}; }
double largest(Vec3d a) noexcept { return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)}); }

// A vector of an instance in world space.
struct Placed {
  Placed(const Affine& map, Vec3d v) noexcept
      : vector(map.vector(v)),
        size(largest(absolute(map.x) * std::abs(v.x) + absolute(map.y) * std::abs(v.y) +
                     absolute(map.z) * std::abs(v.z))) {}

  Vec3d vector;
  double size;  // the largest sum of its terms' magnitudes, to which its rounding is proportional
};

}  // namespace

std::size_t trace_closest(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays, std::span<Hit> hits,
                          Cull cull, std::span<RayCounts> counts, Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(), cull, counts.empty() ? nullptr : counts.data(), hits.data(), nullptr};
  std::size_t in_packets = 0;
  with_view(snapshot, cancel,
            [&](const SceneView& view) { in_packets = trace_closest(view, batch, TraceOptions{strategy}); });
  count_rays(snapshot, rays.size());
  return in_packets;
}

std::size_t trace_occluded(const Snapshot& snapshot, CancelToken& cancel, std::span<const Ray> rays,
                           std::span<std::uint8_t> occluded, Cull cull, std::span<RayCounts> counts,
                           Strategy strategy) {
  const RayBatch batch{rays.data(), rays.size(),    cull, counts.empty() ? nullptr : counts.data(),
                       nullptr,     occluded.data()};
  std::size_t in_packets = 0;
  with_view(snapshot, cancel,
            [&](const SceneView& view) { in_packets = trace_any(view, batch, TraceOptions{strategy}); });
  count_rays(snapshot, rays.size());
  return in_packets;
}

WorldTriangle place_moving_triangle(const Instance& instance, TriangleIndices corners, float time) noexcept {
  const Affine map = place_at(instance, time);
  const Moment moment = moment_of(instance, time);
  const auto place = [&](std::uint32_t vertex) {
    return map.point(to_double(instance.blas->mesh.position_at(vertex, moment)));
  };
  return {place(corners.x), place(corners.y), place(corners.z)};
}

WorldTriangle world_triangle(const Snapshot& snapshot, const Hit& hit, float time) noexcept {
  const Instance& instance = snapshot.instances[hit.instance_index];
  return place_triangle(instance, instance.blas->mesh.triangles[hit.primitive_index], time);
}

Vec3d hit_position(const Snapshot& snapshot, const Hit& hit, float time) noexcept {
  return world_triangle(snapshot, hit, time).at(hit);
}

Vec3d ray_position(const Instance& instance, TriangleIndices corners, const Hit& hit, const Ray& ray) noexcept {
  const Mesh& mesh = instance.blas->mesh;
  const Affine place = place_at(instance, ray.time);
  const Moment moment = moment_of(instance, ray.time);
  const auto position = [&](std::uint32_t vertex) { return to_double(mesh.position_at(vertex, moment)); };
  const Vec3d d = ray.direction, p0 = position(corners.x);
  const Placed edge1(place, position(corners.y) - p0), edge2(place, position(corners.z) - p0);
  const Placed corner(place, p0);
  const Vec3d normal = cross(edge1.vector, edge2.vector), arm = corner.vector + (place.translation - ray.origin);
  const double slope = dot(normal, d), t = dot(normal, arm) / slope;
  // With e = 2^-53: edges are off by 4 e of their terms' magnitudes, so each component of the normal is off by at most
  // 20 e times the product of both. The products are off by 5 e of their terms' magnitudes, and the corner by 4 e of
  // its terms'. So t is off by at most 2^7 e of this, divided by the slope.
  const double size = std::max(edge1.size, edge2.size);
  const double slopes = std::abs(normal.x * d.x) + std::abs(normal.y * d.y) + std::abs(normal.z * d.z);
  const double spread = edge1.size * edge2.size * (size + corner.size / 16) + std::abs(t) * slopes;
  // The point may be off by a millionth of the longest edge.
  const double limit = 0x1p26 * size * std::abs(slope);
  const bool is_exact = spread * largest(d) <= limit && limit > 1e-280 && limit < 1e280;
  return is_exact ? ray.origin + d * t : place_triangle(instance, corners, ray.time).at(hit);
}

// Intersections -------------------------------------------------------------------------------------------------------

namespace {

constexpr std::size_t kUsualHits = 4 * kBlockRays;

// Calls take(row, hits) with all hits of each ray, unsorted and with repetitions. `room` grows to the maximum that one
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

// One ray may have millions of hits, so `cancel` is also checked while they are sorted and stored.
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

// Sorts the hits and removes repetitions. A triangle's t depends only on ray and instance, so its repetitions become
// adjacent. The same holds for each end of a chord through a curve or point; v distinguishes the ends.
std::span<FoundHit> sort_once_each(std::span<FoundHit> hits, const Snapshot& snapshot, CancelToken& cancel) {
  std::size_t comparison_count = 0;
  std::sort(hits.begin(), hits.end(), Nearer{snapshot, cancel, comparison_count});
  const auto same = [&](const FoundHit& a, const FoundHit& b) {
    return a.instance_index == b.instance_index && a.primitive_index == b.primitive_index &&
           (a.v == b.v || snapshot.instance_views[a.instance_index].is_round == 0);
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
