// Rays through snapshots. The Python layer passes columns and preallocated results. All are contiguous, except rays'
// origins and directions.
#include <pybind11/stl.h>

#include <algorithm>

#include "bindings/bind.h"
#include "query/audit.h"
#include "query/closest_points.h"
#include "query/ray_walk.h"
#include "query/trace.h"

namespace perfect_bvh::bindings {
namespace {

using SnapshotPtr = std::shared_ptr<const Snapshot>;

// Uses origins or directions without a copy: rows of three adjacent numbers, at any stride between rows. A single row
// applies to all rays. Returns false if they have another type.
template <class T>
bool set_vectors(const py::array& array, std::size_t& count, const Vec3<T>*& pointer, std::ptrdiff_t& stride) {
  if (!py::isinstance<py::array_t<T>>(array)) return false;
  constexpr auto kBytes = static_cast<py::ssize_t>(sizeof(T));
  const bool are_aligned = (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0;
  const bool are_rows = array.ndim() == 2 && array.shape(1) == 3 &&
                        (array.shape(0) == 0 || array.strides(1) == kBytes) &&
                        (array.shape(0) <= 1 || array.strides(0) % kBytes == 0);
  if (!are_rows || !are_aligned) throw std::invalid_argument("_core: rays must be rows of three aligned numbers");
  count = static_cast<std::size_t>(array.shape(0));
  pointer = static_cast<const Vec3<T>*>(array.data());
  stride = count == 1 ? 0 : array.strides(0) / kBytes;
  return true;
}

void set_columns(const py::array& origins, const py::array& directions, RayColumns& columns) {
  std::size_t origin_count = 0, direction_count = 0;
  if (!set_vectors(origins, origin_count, columns.origins_float, columns.origin_stride) &&
      !set_vectors(origins, origin_count, columns.origins_double, columns.origin_stride)) {
    throw std::invalid_argument("_core: origins must be float32 or float64");
  }
  if (!set_vectors(directions, direction_count, columns.directions_float, columns.direction_stride) &&
      !set_vectors(directions, direction_count, columns.directions_double, columns.direction_stride)) {
    throw std::invalid_argument("_core: directions must be float32 or float64");
  }
  if (origin_count != direction_count && origin_count != 1 && direction_count != 1) {
    throw std::invalid_argument("_core: origins and directions differ in length");
  }
  columns.count = origin_count == 1 ? direction_count : origin_count;
}

template <class T>
std::size_t stride_of(const Array<T>& column, std::size_t count) {
  if (column.size() != 1 && static_cast<std::size_t>(column.size()) != count) {
    throw std::invalid_argument("_core: a column must have one value or one a ray");
  }
  return column.size() == 1 ? 0 : 1;
}

Cull parse_cull(const std::string& name) {
  if (name == "none") return Cull::kNone;
  if (name == "back") return Cull::kBack;
  throw InvalidArgument("cull must be 'none' or 'back', got '" + name + "'");
}

Strategy parse_strategy(const std::string& name) {
  if (name == "auto") return Strategy::kAuto;
  if (name == "packets") return Strategy::kPackets;
  if (name == "stream") return Strategy::kStream;
  if (name == "single") return Strategy::kSingle;
  throw InvalidArgument("strategy must be 'auto', 'packets', 'stream' or 'single', got '" + name + "'");
}

template <class T>
Array<T> column_of(const py::handle& value) {
  if (!py::isinstance<Array<T>>(value)) throw std::invalid_argument("_core: a column of rays has the wrong dtype");
  return py::reinterpret_borrow<Array<T>>(value);
}

// Reads origins, directions, t_min, t_max, masks, times and cull. The caller keeps the arrays alive.
RayColumns read_rays(const py::tuple& given) {
  if (given.size() != 7) throw std::invalid_argument("_core: rays are a tuple of seven");
  RayColumns columns;
  set_columns(given[0].cast<py::array>(), given[1].cast<py::array>(), columns);
  const auto t_min = column_of<float>(given[2]), t_max = column_of<float>(given[3]), times = column_of<float>(given[5]);
  const auto masks = column_of<std::uint32_t>(given[4]);
  columns.t_min = t_min.data(), columns.t_min_stride = stride_of(t_min, columns.count);
  columns.t_max = t_max.data(), columns.t_max_stride = stride_of(t_max, columns.count);
  columns.masks = masks.data(), columns.mask_stride = stride_of(masks, columns.count);
  columns.times = times.data(), columns.time_stride = stride_of(times, columns.count);
  columns.cull = parse_cull(given[6].cast<std::string>());
  return columns;
}

// Returns the writable memory of an output column with `width` values a ray; null if the column was not requested.
template <class T>
T* writable(const py::dict& columns, const char* name, std::size_t count, std::size_t width) {
  if (!columns.contains(name)) return nullptr;
  auto array = columns[name].cast<py::array>();
  if (!py::isinstance<Array<T>>(array) || static_cast<std::size_t>(array.size()) != count * width ||
      !array.writeable()) {
    throw std::invalid_argument(std::string("_core: output column ") + name + " has the wrong dtype, size or flags");
  }
  return static_cast<T*>(array.mutable_data());
}

HitColumns read_outputs(const py::dict& columns, std::size_t count) {
  HitColumns out;
  out.t = writable<float>(columns, "t_hit", count, 1);
  out.instance_ids = writable<std::int32_t>(columns, "instance_ids", count, 1);
  out.mesh_ids = writable<std::int32_t>(columns, "mesh_ids", count, 1);
  out.primitive_ids = writable<std::int32_t>(columns, "primitive_ids", count, 1);
  out.uvs = writable<float>(columns, "primitive_uvs", count, 2);
  out.normals = writable<float>(columns, "geometric_normals", count, 3);
  out.positions = writable<double>(columns, "positions", count, 3);
  out.distances = writable<double>(columns, "distances", count, 1);
  out.front_face = reinterpret_cast<std::uint8_t*>(writable<bool>(columns, "front_face", count, 1));
  out.nodes_visited = writable<std::int32_t>(columns, "nodes_visited", count, 1);
  out.primitives_tested = writable<std::int32_t>(columns, "primitives_tested", count, 1);
  return out;
}

PointColumns read_points(const Array<double>& points, const Array<double>& max_distances,
                         const Array<std::uint32_t>& masks, const Array<float>& times) {
  const auto vectors = as_vectors(points);
  PointColumns columns;
  columns.count = vectors.size(), columns.points = vectors.data();
  columns.max_distances = max_distances.data(), columns.max_distance_stride = stride_of(max_distances, columns.count);
  columns.masks = masks.data(), columns.mask_stride = stride_of(masks, columns.count);
  columns.times = times.data(), columns.time_stride = stride_of(times, columns.count);
  return columns;
}

ClosestColumns read_closest(const py::dict& columns, std::size_t count) {
  ClosestColumns out;
  out.points = writable<double>(columns, "points", count, 3);
  out.distances = writable<double>(columns, "distances", count, 1);
  out.instance_ids = writable<std::int32_t>(columns, "instance_ids", count, 1);
  out.mesh_ids = writable<std::int32_t>(columns, "mesh_ids", count, 1);
  out.primitive_ids = writable<std::int32_t>(columns, "primitive_ids", count, 1);
  out.uvs = writable<float>(columns, "primitive_uvs", count, 2);
  if (!out.points || !out.distances || !out.instance_ids || !out.mesh_ids || !out.primitive_ids || !out.uvs) {
    throw std::invalid_argument("_core: a closest point needs all of its columns");
  }
  return out;
}

void check_splits(std::span<const std::int64_t> splits) {
  if (splits.front() != 0 || !std::is_sorted(splits.begin(), splits.end())) {
    throw std::invalid_argument("_core: ray_splits must rise from 0");
  }
}

py::dict to_dict(const RayWalk& walk) {
  static_assert(sizeof(WalkEvent) == 1);
  const Array<std::uint8_t> events(static_cast<py::ssize_t>(walk.count()),
                                   reinterpret_cast<const std::uint8_t*>(walk.events.data()));
  return py::dict(py::arg("events") = events, py::arg("bounds") = to_column(walk.bounds).reshape({-1, 2, 3}),
                  py::arg("transforms") = to_column(walk.transforms).reshape({-1, 3, 4}),
                  py::arg("triangles") = to_column(walk.triangles).reshape({-1, 3, 3}),
                  py::arg("t") = to_column(walk.t), py::arg("nearest_t") = to_column(walk.nearest_t),
                  py::arg("levels") = to_column(walk.levels), py::arg("instance_ids") = to_column(walk.instance_ids),
                  py::arg("mesh_ids") = to_column(walk.mesh_ids),
                  py::arg("primitive_ids") = to_column(walk.primitive_ids));
}

}  // namespace

void bind_queries(py::module_& module) {
  py::class_<Snapshot, std::shared_ptr<Snapshot>> snapshot(module, "Snapshot");
  make_only_natively(snapshot);
  snapshot.def_property_readonly("generation", [](const Snapshot& self) { return self.generation; });
  snapshot.def_property_readonly("scene_id", [](const Snapshot& self) { return self.scene_id; });
  snapshot.def(
      "cast_rays",
      [](const Snapshot& self, const py::tuple& given, const std::string& strategy, const py::dict& outputs,
         int threads, const py::object& progress) {
        RayColumns rays = read_rays(given);
        rays.strategy = parse_strategy(strategy);
        const HitColumns hits = read_outputs(outputs, rays.count);
        return with_progress(progress, [&](CancelToken& cancel) {
          const BatchSummary summary = cast_rays(self, rays, hits, ThreadPool::shared(), threads, cancel);
          return std::pair(summary.invalid_count, summary.packet_count);
        });
      },
      py::arg("rays"), py::arg("strategy"), py::arg("outputs"), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "test_occlusions",
      [](const Snapshot& self, const py::tuple& given, const std::string& strategy, Array<bool>& occluded, int threads,
         const py::object& progress) {
        RayColumns rays = read_rays(given);
        rays.strategy = parse_strategy(strategy);
        if (static_cast<std::size_t>(occluded.size()) != rays.count) {
          throw std::invalid_argument("_core: occluded has the wrong size");
        }
        auto* const out = reinterpret_cast<std::uint8_t*>(occluded.mutable_data());
        return with_progress(progress, [&](CancelToken& cancel) {
          return test_occlusions(self, rays, out, ThreadPool::shared(), threads, cancel);
        });
      },
      py::arg("rays"), py::arg("strategy"), py::arg("occluded").noconvert(), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "audit_answers",
      [](const Snapshot& self, const py::tuple& given, const Array<float>& t_hit,
         const Array<std::int32_t>& instance_ids, const Array<std::int32_t>& primitive_ids, int threads,
         const py::object& progress) {
        const RayColumns rays = read_rays(given);
        for (const py::ssize_t size : {t_hit.size(), instance_ids.size(), primitive_ids.size()}) {
          if (static_cast<std::size_t>(size) != rays.count) {
            throw std::invalid_argument("_core: an audited column has the wrong size");
          }
        }
        const AuditedAnswers answers{t_hit.data(), instance_ids.data(), primitive_ids.data()};
        Array<std::uint8_t> verdicts(static_cast<py::ssize_t>(rays.count));
        std::uint8_t* const rows = verdicts.mutable_data();
        with_progress(progress, [&](CancelToken& cancel) {
          audit_answers(self, rays, answers, rows, ThreadPool::shared(), threads, cancel);
        });
        return verdicts;
      },
      py::arg("rays"), py::arg("t_hit").noconvert(), py::arg("instance_ids").noconvert(),
      py::arg("primitive_ids").noconvert(), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "count_intersections",
      [](const Snapshot& self, const py::tuple& given, Array<std::int32_t>& counts, int threads,
         const py::object& progress) {
        const RayColumns rays = read_rays(given);
        if (static_cast<std::size_t>(counts.size()) != rays.count) {
          throw std::invalid_argument("_core: counts has the wrong size");
        }
        std::int32_t* const out = counts.mutable_data();
        return with_progress(progress, [&](CancelToken& cancel) {
          return count_intersections(self, rays, out, ThreadPool::shared(), threads, cancel);
        });
      },
      py::arg("rays"), py::arg("counts").noconvert(), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "list_intersections",
      [](const Snapshot& self, const py::tuple& given, const Array<std::int64_t>& ray_splits, const py::dict& outputs,
         int threads, const py::object& progress) {
        const RayColumns rays = read_rays(given);
        const auto splits = as_span(ray_splits);
        if (splits.size() != rays.count + 1) throw std::invalid_argument("_core: ray_splits has the wrong size");
        check_splits(splits);
        const HitColumns hits = read_outputs(outputs, static_cast<std::size_t>(splits.back()));
        return with_progress(progress, [&](CancelToken& cancel) {
          return list_intersections(self, rays, splits, hits, ThreadPool::shared(), threads, cancel);
        });
      },
      py::arg("rays"), py::arg("ray_splits").noconvert(), py::arg("outputs"), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "compute_closest_points",
      [](const Snapshot& self, const Array<double>& points, const Array<double>& max_distances,
         const Array<std::uint32_t>& masks, const Array<float>& times, const py::dict& outputs, int threads,
         const py::object& progress) {
        const PointColumns columns = read_points(points, max_distances, masks, times);
        const ClosestColumns closest = read_closest(outputs, columns.count);
        return with_progress(progress, [&](CancelToken& cancel) {
          return compute_closest_points(self, columns, closest, ThreadPool::shared(), threads, cancel);
        });
      },
      py::arg("points").noconvert(), py::arg("max_distances").noconvert(), py::arg("masks").noconvert(),
      py::arg("times").noconvert(), py::arg("outputs"), py::arg("threads"), py::arg("progress"));
  snapshot.def(
      "walk_ray",
      [](const Snapshot& self, const py::tuple& given, const py::object& progress) {
        const RayColumns rays = read_rays(given);
        if (rays.count != 1) throw std::invalid_argument("_core: walk_ray takes one ray");
        const Ray ray = load_ray(rays, 0);
        return to_dict(
            with_progress(progress, [&](CancelToken& cancel) { return walk_ray(self, ray, rays.cull, cancel); }));
      },
      py::arg("rays"), py::arg("progress"));
}

}  // namespace perfect_bvh::bindings
