// The Python layer has checked shapes and dtypes of inputs; the engine checks the values.
#include "scene/scene.h"

#include <pybind11/stl.h>

#include <utility>

#include "bindings/bind.h"

namespace perfect_bvh::bindings {
namespace {

template <class T>
BallsGiven<T> as_balls(const Array<T>& centres, const Array<T>& radii) {
  return {as_vectors(centres), as_span(radii)};
}

CurveShape shape_of(bool is_ribbon) noexcept { return is_ribbon ? CurveShape::kRibbon : CurveShape::kRound; }

template <class T>
std::int32_t add_points(Scene& scene, const Array<T>& centres, const Array<T>& radii, const py::dict& settings,
                        const std::string& usage) {
  const BuildConfig config = parse_config(settings);
  const Usage expected = parse_usage(usage);
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  return scene.add_mesh(make_points(balls, "add_points"), config, expected);
}

template <class T>
std::int32_t add_curves(Scene& scene, const Array<T>& points, const Array<T>& radii, const Array<std::int64_t>& offsets,
                        const Array<std::uint8_t>& cyclic, bool is_ribbon, const py::dict& settings,
                        const std::string& usage) {
  const BuildConfig config = parse_config(settings);
  const Usage expected = parse_usage(usage);
  const auto balls = as_balls(points, radii);
  const auto starts = as_span(offsets);
  const auto closed = as_span(cyclic);
  const py::gil_scoped_release release;
  return scene.add_mesh(make_curves(balls, starts, shape_of(is_ribbon), "add_curves", closed), config, expected);
}

template <class T>
void replace_points(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii) {
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  scene.replace_mesh(mesh_id, make_points(balls, "replace_points"), "replace_points");
}

template <class T>
void replace_curves(Scene& scene, std::int32_t mesh_id, const Array<T>& points, const Array<T>& radii,
                    const Array<std::int64_t>& offsets, const Array<std::uint8_t>& cyclic, bool is_ribbon) {
  const auto balls = as_balls(points, radii);
  const auto starts = as_span(offsets);
  const auto closed = as_span(cyclic);
  const py::gil_scoped_release release;
  scene.replace_mesh(mesh_id, make_curves(balls, starts, shape_of(is_ribbon), "replace_curves", closed),
                     "replace_curves");
}

template <class T>
void set_chains(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii,
                const Array<std::int64_t>& offsets) {
  const auto balls = as_balls(centres, radii);
  const auto starts = as_span(offsets);
  const py::gil_scoped_release release;
  scene.set_chains(mesh_id, balls, starts);
}

template <class T, PrimitiveKind kKind>
void update_balls(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii) {
  const auto balls = as_balls(centres, radii);
  const py::gil_scoped_release release;
  scene.update_balls(mesh_id, kKind, balls, ThreadPool::shared());
}

// Sets the spheres of all steps, one step after another. Without offsets the existing ones apply.
template <class T, PrimitiveKind kKind>
void set_motion(Scene& scene, std::int32_t mesh_id, const Array<T>& centres, const Array<T>& radii,
                const Array<std::int64_t>& offsets, std::size_t steps, const std::pair<float, float>& range) {
  const auto balls = as_balls(centres, radii);
  const auto starts = as_span(offsets);
  const py::gil_scoped_release release;
  scene.set_round_motion(mesh_id, kKind, balls, starts, step_times(steps, range));
}

template <class T>
void bind_edits_of(py::class_<Scene>& scene) {
  scene.def("add_points", &add_points<T>, py::arg("centers").noconvert(), py::arg("radii").noconvert(),
            py::arg("settings"), py::arg("usage"));
  scene.def("add_curves", &add_curves<T>, py::arg("points").noconvert(), py::arg("radii").noconvert(),
            py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(), py::arg("is_ribbon"),
            py::arg("settings"), py::arg("usage"));
  scene.def("update_points", &update_balls<T, PrimitiveKind::kPoints>, py::arg("mesh_id"),
            py::arg("centers").noconvert(), py::arg("radii").noconvert());
  scene.def("update_curves", &update_balls<T, PrimitiveKind::kCurves>, py::arg("mesh_id"),
            py::arg("points").noconvert(), py::arg("radii").noconvert());
  scene.def("set_points_motion", &set_motion<T, PrimitiveKind::kPoints>, py::arg("mesh_id"),
            py::arg("centers").noconvert(), py::arg("radii").noconvert(), py::arg("offsets").noconvert(),
            py::arg("steps"), py::arg("time_range"));
  scene.def("set_curves_motion", &set_motion<T, PrimitiveKind::kCurves>, py::arg("mesh_id"),
            py::arg("points").noconvert(), py::arg("radii").noconvert(), py::arg("offsets").noconvert(),
            py::arg("steps"), py::arg("time_range"));
  scene.def("set_chains", &set_chains<T>, py::arg("mesh_id"), py::arg("centers").noconvert(),
            py::arg("radii").noconvert(), py::arg("offsets").noconvert());
  scene.def("replace_points", &replace_points<T>, py::arg("mesh_id"), py::arg("centers").noconvert(),
            py::arg("radii").noconvert());
  scene.def("replace_curves", &replace_curves<T>, py::arg("mesh_id"), py::arg("points").noconvert(),
            py::arg("radii").noconvert(), py::arg("curve_offsets").noconvert(), py::arg("cyclic").noconvert(),
            py::arg("is_ribbon"));
}

}  // namespace

void bind_round_edits(py::class_<Scene>& scene) {
  bind_edits_of<float>(scene);
  bind_edits_of<double>(scene);
}

// Scene ---------------------------------------------------------------------------------------------------------------
// Editing and committing. The Python layer has checked shapes and dtypes of inputs; the engine checks the values.

namespace {

// Views an array of shape (count, 3, 4) or (count, 4, 4) as matrices.
template <class T>
Matrices<T> as_matrices(const Array<T>& array, std::size_t count) {
  if (array.ndim() != 3 || static_cast<std::size_t>(array.shape(0)) != count ||
      (array.shape(1) != 3 && array.shape(1) != 4) || array.shape(2) != 4) {
    throw std::invalid_argument("_core: expected transforms of shape (rows, 3 or 4, 4), as many as ids");
  }
  return {array.data(), count, static_cast<std::size_t>(array.shape(1))};
}

const char* action_name(MeshAction action) {
  switch (action) {
    case MeshAction::kKept:
      return "kept";
    case MeshAction::kBuilt:
      return "built";
    case MeshAction::kRefitted:
      return "refitted";
    case MeshAction::kRotated:
      return "rotated";
    case MeshAction::kPartlyRebuilt:
      return "partly_rebuilt";
    case MeshAction::kRebuilt:
      return "rebuilt";
  }
  return "kept";
}

Policy parse_policy(const std::string& name) {
  if (name == "governed") return Policy::kGoverned;
  if (name == "refit") return Policy::kRefit;
  if (name == "rotate") return Policy::kRotate;
  if (name == "rebuild_parts") return Policy::kRebuildParts;
  if (name == "rebuild") return Policy::kRebuild;
  throw InvalidArgument("Scene: policy must be 'governed', 'refit', 'rotate', 'rebuild_parts' or 'rebuild', got '" +
                        name + "'");
}

BuilderCost parse_cost(const py::dict& numbers, const char* builder) {
  const auto row = numbers[builder].cast<py::dict>();
  return {row["build_nanoseconds"].cast<double>(), row["trace_nanoseconds"].cast<double>()};
}

CommitOptions parse_options(const std::string& policy, const std::optional<double>& expected_rays,
                            const py::dict& numbers) {
  CommitOptions options;
  options.policy = parse_policy(policy);
  options.expected_rays = expected_rays;
  Calibration& calibration = options.calibration;
  calibration.node_nanoseconds = numbers["node_nanoseconds"].cast<double>();
  calibration.leaf_nanoseconds = numbers["leaf_nanoseconds"].cast<double>();
  calibration.refit_nanoseconds = numbers["refit_nanoseconds"].cast<double>();
  calibration.rotate_nanoseconds = numbers["rotate_nanoseconds"].cast<double>();
  calibration.rebuild_parts_nanoseconds = numbers["rebuild_parts_nanoseconds"].cast<double>();
  calibration.rotation_gain = numbers["rotation_gain"].cast<double>();
  const auto builders = numbers["builders"].cast<py::dict>();
  calibration.fast = parse_cost(builders, "fast");
  calibration.binned = parse_cost(builders, "binned");
  calibration.spatial = parse_cost(builders, "spatial");
  return options;
}

py::list to_list(const std::vector<AlternativeReport>& alternatives) {
  py::list rows;
  for (const AlternativeReport& row : alternatives) {
    rows.append(py::dict(py::arg("action") = action_name(row.action), py::arg("builder") = row.builder,
                         py::arg("update_milliseconds") = row.update_milliseconds,
                         py::arg("trace_milliseconds") = row.trace_milliseconds));
  }
  return rows;
}

py::dict to_dict(const TopLevelReport& top) {
  return py::dict(py::arg("is_refitted") = top.is_refitted, py::arg("reason") = top.reason,
                  py::arg("builder") = top.builder, py::arg("placing_milliseconds") = top.placing_milliseconds,
                  py::arg("refit_milliseconds") = top.refit_milliseconds,
                  py::arg("build_milliseconds") = top.build_milliseconds,
                  py::arg("clustering_milliseconds") = top.clustering_milliseconds,
                  py::arg("collapse_milliseconds") = top.collapse_milliseconds);
}

py::list to_list(const std::vector<MeshReport>& reports) {
  py::list meshes;
  for (const MeshReport& mesh : reports) {
    meshes.append(py::dict(
        py::arg("mesh_id") = mesh.mesh_id, py::arg("usage") = mesh.usage, py::arg("action") = action_name(mesh.action),
        py::arg("reason") = mesh.reason, py::arg("alternatives") = to_list(mesh.alternatives),
        py::arg("expected_rays") = mesh.expected_rays, py::arg("node_visits") = mesh.node_visits,
        py::arg("leaf_visits") = mesh.leaf_visits, py::arg("builder") = mesh.builder,
        py::arg("milliseconds") = mesh.milliseconds, py::arg("build_milliseconds") = mesh.build_milliseconds,
        py::arg("optimize_milliseconds") = mesh.optimize_milliseconds,
        py::arg("refit_milliseconds") = mesh.refit_milliseconds,
        py::arg("restructure_milliseconds") = mesh.restructure_milliseconds,
        py::arg("restructured_share") = mesh.restructured_share, py::arg("fresh_cost") = mesh.fresh_cost,
        py::arg("refitted_cost") = mesh.refitted_cost, py::arg("cost") = mesh.cost,
        py::arg("collapse_milliseconds") = mesh.collapse_milliseconds, py::arg("kind") = mesh.kind,
        py::arg("triangle_count") = mesh.triangle_count, py::arg("byte_count") = mesh.byte_count));
  }
  return meshes;
}

py::dict to_dict(const CommitReport& report) {
  return py::dict(py::arg("meshes") = to_list(report.meshes), py::arg("resting") = to_list(report.resting),
                  py::arg("kept_count") = report.kept_count, py::arg("instance_count") = report.instance_count,
                  py::arg("baked_count") = report.baked_count, py::arg("mesh_milliseconds") = report.mesh_milliseconds,
                  py::arg("top_level_milliseconds") = report.top_level_milliseconds,
                  py::arg("top_level") = to_dict(report.top_level), py::arg("milliseconds") = report.milliseconds,
                  py::arg("byte_count") = report.byte_count, py::arg("generation") = report.generation);
}

template <class T>
Mesh read_mesh(const Array<T>& positions, const Array<std::int32_t>& triangles, const char* function) {
  const auto vertices = as_vectors(positions);
  const auto corners = as_vectors(triangles);
  const py::gil_scoped_release release;
  return make_mesh(vertices, corners, function);
}

template <class T>
std::int32_t add_mesh(Scene& scene, const Array<T>& positions, const Array<std::int32_t>& triangles,
                      const py::dict& settings, const std::string& usage) {
  const BuildConfig config = parse_config(settings);
  const Usage expected = parse_usage(usage);
  Mesh mesh = read_mesh(positions, triangles, "add_mesh");
  const py::gil_scoped_release release;
  return scene.add_mesh(std::move(mesh), config, expected);
}

template <class T>
void update_mesh(Scene& scene, std::int32_t mesh_id, const Array<T>& positions) {
  const auto vertices = as_vectors(positions);
  const py::gil_scoped_release release;
  scene.update_mesh(mesh_id, vertices, ThreadPool::shared());
}

template <class T>
void replace_mesh(Scene& scene, std::int32_t mesh_id, const Array<T>& positions, const Array<std::int32_t>& triangles) {
  Mesh mesh = read_mesh(positions, triangles, "replace_mesh");
  const py::gil_scoped_release release;
  scene.replace_mesh(mesh_id, std::move(mesh));
}

template <class T>
std::int32_t add_instances(Scene& scene, const Array<std::int32_t>& meshes, const Array<T>& transforms,
                           const Array<std::uint32_t>& masks, const std::optional<Array<std::int64_t>>& orders) {
  const auto mesh_ids = as_span(meshes);
  const auto matrices = as_matrices(transforms, mesh_ids.size());
  const auto mask_values = as_span(masks);
  const auto order_values = orders ? as_span(*orders) : std::span<const std::int64_t>();
  const py::gil_scoped_release release;
  return scene.add_instances(mesh_ids, matrices, mask_values, order_values);
}

template <class T>
void set_transforms(Scene& scene, const Array<std::int32_t>& ids, const Array<T>& transforms) {
  const auto rows = as_span(ids);
  const auto matrices = as_matrices(transforms, rows.size());
  const py::gil_scoped_release release;
  scene.set_transforms(rows, matrices, ThreadPool::shared());
}

// transforms: all instances at the first step, then all at the second, and so on.
template <class T>
void set_instance_motion(Scene& scene, const Array<std::int32_t>& ids, const Array<T>& transforms, std::size_t steps,
                         const std::pair<float, float>& range) {
  const auto rows = as_span(ids);
  const auto matrices = as_matrices(transforms, rows.size() * steps);
  const py::gil_scoped_release release;
  scene.set_instance_motion(rows, matrices, step_times(steps, range));
}

template <class T>
void set_mesh_motion(Scene& scene, std::int32_t mesh_id, const Array<T>& positions, std::size_t steps,
                     const std::pair<float, float>& range) {
  const auto vertices = as_vectors(positions);
  const py::gil_scoped_release release;
  scene.set_mesh_motion(mesh_id, vertices, step_times(steps, range), ThreadPool::shared());
}

template <class T>
void bind_instance_edits(py::class_<Scene>& scene) {
  scene.def("add_instances", &add_instances<T>, py::arg("meshes").noconvert(), py::arg("transforms").noconvert(),
            py::arg("masks").noconvert(), py::arg("orders").noconvert() = std::nullopt);
  scene.def("set_transforms", &set_transforms<T>, py::arg("ids").noconvert(), py::arg("transforms").noconvert());
  scene.def("set_instance_motion", &set_instance_motion<T>, py::arg("ids").noconvert(),
            py::arg("transforms").noconvert(), py::arg("steps"), py::arg("time_range"));
}

template <class T>
void bind_mesh_edits(py::class_<Scene>& scene) {
  scene.def("add_mesh", &add_mesh<T>, py::arg("positions").noconvert(), py::arg("triangles").noconvert(),
            py::arg("settings"), py::arg("usage"));
  scene.def("update_mesh", &update_mesh<T>, py::arg("mesh_id"), py::arg("positions").noconvert());
  scene.def("set_mesh_motion", &set_mesh_motion<T>, py::arg("mesh_id"), py::arg("positions").noconvert(),
            py::arg("steps"), py::arg("time_range"));
  scene.def("replace_mesh", &replace_mesh<T>, py::arg("mesh_id"), py::arg("positions").noconvert(),
            py::arg("triangles").noconvert());
}

}  // namespace

void bind_scene(py::module_& module) {
  py::class_<Scene> scene(module, "Scene");
  make_only_natively(scene);
  module.def("make_scene", [] { return std::make_unique<Scene>(); });
  bind_mesh_edits<float>(scene);
  bind_mesh_edits<double>(scene);
  bind_round_edits(scene);
  bind_instance_edits<float>(scene);
  bind_instance_edits<double>(scene);
  scene.def(
      "set_usage",
      [](Scene& self, std::int32_t mesh_id, const std::string& usage) { self.set_usage(mesh_id, parse_usage(usage)); },
      py::arg("mesh_id"), py::arg("usage"), py::call_guard<py::gil_scoped_release>());
  scene.def("remove_mesh", &Scene::remove_mesh, py::arg("mesh_id"), py::call_guard<py::gil_scoped_release>());
  scene.def(
      "set_masks",
      [](Scene& self, const Array<std::int32_t>& ids, const Array<std::uint32_t>& masks) {
        const auto rows = as_span(ids);
        const auto values = as_span(masks);
        const py::gil_scoped_release release;
        self.set_masks(rows, values);
      },
      py::arg("ids").noconvert(), py::arg("masks").noconvert());
  scene.def(
      "remove_instances",
      [](Scene& self, const Array<std::int32_t>& ids) {
        const auto rows = as_span(ids);
        const py::gil_scoped_release release;
        self.remove_instances(rows);
      },
      py::arg("ids").noconvert());
  scene.def(
      "commit",
      [](Scene& self, const std::string& policy, const std::optional<double>& expected_rays,
         const py::dict& calibration, const py::object& progress) {
        const CommitOptions options = parse_options(policy, expected_rays, calibration);
        const CommitReport report = with_progress(
            progress, [&](CancelToken& cancel) { return self.commit(ThreadPool::shared(), cancel, options); });
        return to_dict(report);
      },
      py::arg("policy"), py::arg("expected_rays"), py::arg("calibration"), py::arg("progress") = py::none());
  scene.def("mark_stale", &Scene::mark_stale, py::arg("why"), py::call_guard<py::gil_scoped_release>());
  scene.def("is_current", &Scene::is_current, py::call_guard<py::gil_scoped_release>());
  scene.def(
      "snapshot", [](const Scene& self) { return std::const_pointer_cast<Snapshot>(self.snapshot()); },
      py::call_guard<py::gil_scoped_release>());
  scene.def("scene_id", &Scene::id);
  scene.def("rays_cast", &Scene::rays_cast);
  scene.def("mesh_count", &Scene::mesh_count, py::call_guard<py::gil_scoped_release>());
  scene.def("instance_count", &Scene::instance_count, py::call_guard<py::gil_scoped_release>());
}

}  // namespace perfect_bvh::bindings
