// Images of snapshots. The Python layer passes checked arrays, which it keeps alive, and preallocated results.
#include "render/image/render.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <map>

#include "bindings/bind.h"
#include "core/errors.h"
#include "math/elementary.h"
#include "render/light/emitters.h"
#include "render/modes/shading.h"

namespace perfect_bvh::bindings {
namespace {

const std::map<std::string, Mode> kModes{
    {"preview", Mode::kPreview},     {"clay", Mode::kClay},         {"matcap", Mode::kMatcap},
    {"wireframe", Mode::kWireframe}, {"normal", Mode::kNormal},     {"uv", Mode::kUv},
    {"depth", Mode::kDepth},         {"distance", Mode::kDistance}, {"instance", Mode::kInstance},
    {"material", Mode::kMaterial},   {"cost", Mode::kCost},
};

const std::map<std::string, Extension> kExtensions{{"repeat", Extension::kRepeat},
                                                   {"extend", Extension::kExtend},
                                                   {"clip", Extension::kClip},
                                                   {"mirror", Extension::kMirror},
                                                   {"sky", Extension::kSky}};

Vec3f as_color(const py::handle& value) {
  const auto [r, g, b] = value.cast<std::tuple<float, float, float>>();
  return {r, g, b};
}

LightPaths read_light_paths(const py::dict& values) {
  LightPaths paths;
  paths.max_bounces = get<int>(values, "max_bounces");
  paths.diffuse_bounces = get<int>(values, "diffuse_bounces");
  paths.glossy_bounces = get<int>(values, "glossy_bounces");
  paths.transmission_bounces = get<int>(values, "transmission_bounces");
  paths.transparent_bounces = get<int>(values, "transparent_bounces");
  paths.clamp_direct = get<float>(values, "clamp_direct");
  paths.clamp_indirect = get<float>(values, "clamp_indirect");
  paths.filter_glossy = get<float>(values, "filter_glossy");
  paths.reflective_caustics = get<bool>(values, "reflective_caustics");
  paths.refractive_caustics = get<bool>(values, "refractive_caustics");
  return paths;
}

RenderSettings read_settings(const py::dict& values) {
  RenderSettings settings;
  settings.mode = kModes.at(get<std::string>(values, "mode"));
  settings.width = get<int>(values, "width");
  settings.height = get<int>(values, "height");
  settings.samples = get<std::uint32_t>(values, "samples");
  settings.first_sample = get<std::uint32_t>(values, "first_sample");
  settings.is_continued = get<bool>(values, "is_continued");
  settings.filter_width = get<float>(values, "filter_width");
  settings.seed = get<std::uint32_t>(values, "seed");
  settings.threads = get<int>(values, "threads");
  settings.kept_share = get<float>(values, "kept_share");
  if (!values["tiles"].is_none()) settings.wanted_tiles = rows_of<std::uint8_t>(view<bool>(values, "tiles"));
  if (!values["shutter"].is_none()) settings.shutter = read_shutter(values["shutter"].cast<py::dict>());
  settings.clay.ao_distance = get<float>(values, "ao_distance");
  settings.clay.light_rays = get<int>(values, "light_rays");
  settings.light_paths = read_light_paths(values["light_paths"].cast<py::dict>());
  if (!values["clay_color"].is_none()) settings.clay.color = as_color(values["clay_color"]);
  settings.wireframe.width = get<float>(values, "wire_width");
  settings.wireframe.color = as_color(values["wire_color"]);
  return settings;
}

void read_pixels(const py::dict& values, const char* name, Texture& texture) {
  const auto pixels = values[name].cast<py::array>();
  if (pixels.ndim() != 3 || pixels.shape(2) != 4) throw std::invalid_argument("_core: an image must be (H, W, 4)");
  texture.height = static_cast<int>(pixels.shape(0)), texture.width = static_cast<int>(pixels.shape(1));
  if (py::isinstance<Array<std::uint8_t>>(pixels)) {
    texture.bytes = static_cast<const std::uint8_t*>(pixels.data());
  } else {
    texture.floats = view<float>(values, name).data();
  }
}

// Reads the tiles of an image, numbered from 0.
std::shared_ptr<const TextureTiles> read_tiles(const py::handle& value, const Texture& whole) {
  const auto tiles = value.cast<std::vector<py::dict>>();
  if (tiles.empty()) return nullptr;
  auto made = std::make_shared<TextureTiles>();
  for (const py::dict& tile : tiles) {
    const auto square = get<std::size_t>(tile, "square");
    const std::size_t row_end = (square / TextureTiles::kColumns + 1) * TextureTiles::kColumns;
    if (row_end > made->rows.size()) made->rows.resize(row_end, -1);
    made->rows[square] = static_cast<std::int32_t>(made->images.size());
    Texture& texture = made->images.emplace_back();
    texture.extension = whole.extension, texture.is_closest = whole.is_closest, texture.is_linear = whole.is_linear;
    read_pixels(tile, "pixels", texture);
  }
  return made;
}

}  // namespace

Texture read_image(const py::handle& value) {
  const auto values = value.cast<py::dict>();
  Texture texture;
  texture.extension = kExtensions.at(get<std::string>(values, "extension"));
  texture.is_closest = get<std::string>(values, "interpolation") == "closest";
  texture.is_linear = get<bool>(values, "is_linear");
  read_pixels(values, "pixels", texture);
  texture.tiles = read_tiles(values["tiles"], texture);
  return texture;
}

namespace {

// The columns have equal length; the Python layer has checked it.
void read_lights(const py::dict& values, std::vector<Light>& lights) {
  const auto kinds = view<std::int32_t>(values, "kinds");
  const auto positions = rows_of<Vec3d>(view<double>(values, "positions"));
  const auto axes = rows_of<std::array<Vec3f, 3>>(view<float>(values, "axes"));
  const auto powers = rows_of<Vec3f>(view<float>(values, "powers"));
  const auto sizes = rows_of<Point2>(view<float>(values, "sizes"));
  const auto cones = rows_of<Point2>(view<float>(values, "cones"));
  const auto casts_shadow = rows_of<std::uint8_t>(view<bool>(values, "casts_shadow"));
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    Light& light = lights.emplace_back();
    light.kind = static_cast<LightKind>(kinds[i]);
    light.casts_shadow = casts_shadow[i] != 0;
    light.position = positions[i];
    light.x = axes[i][0], light.y = axes[i][1], light.z = axes[i][2];
    light.power = powers[i];
    light.size_x = sizes[i].x, light.size_y = sizes[i].y;
    light.cone_cosine = cosine(0.5f * cones[i].x), light.cone_blend = cones[i].y;
    light.spread = 0.5f * cones[i].x;
  }
}

// Reads columns, as for the lights.
void read_hair(const py::dict& values, std::vector<Hair>& rows) {
  const auto numbers = [&](const char* name) { return view<float>(values, name); };
  const auto colored = rows_of<std::uint8_t>(view<bool>(values, "colored"));
  const auto surfaces = numbers("surfaces"), fibers = numbers("fibers"), coats = numbers("coats");
  const auto tilts = numbers("tilts"), iors = numbers("iors");
  const auto absorptions = rows_of<Vec3f>(numbers("absorptions"));
  const auto roughnesses = rows_of<Point2>(numbers("roughnesses"));
  for (std::size_t i = 0; i < fibers.size(); ++i) {
    rows.push_back({surfaces[i], fibers[i], absorptions[i], colored[i] != 0, roughnesses[i].x, roughnesses[i].y,
                    coats[i], tilts[i], iors[i]});
  }
}

std::optional<World> read_world(const py::handle& value) {
  if (value.is_none()) return std::nullopt;
  const auto world = value.cast<py::dict>();
  return World{as_color(world["color"]), get<std::int32_t>(world, "image"), get<float>(world, "rotation")};
}

void read_scene_light(const py::dict& values, Appearance& appearance) {
  for (const py::handle image : values["images"]) appearance.images.push_back(read_image(image));
  read_lights(values["lights"].cast<py::dict>(), appearance.lights);
  appearance.world = read_world(values["world"]);
  appearance.backdrop = read_world(values["backdrop"]);
  const py::handle sky = values["bright_sky"];
  if (!sky.is_none()) appearance.bright_sky = sky.cast<std::shared_ptr<BrightSky>>();
}

// Reads the layers of a mesh, by number; None for a layer that the mesh lacks.
template <class T>
void read_layers(const py::dict& mesh, const char* name, std::vector<std::span<const T>>& layers) {
  for (const py::handle value : mesh[name]) {
    if (value.is_none()) {
      layers.emplace_back();
      continue;
    }
    const auto array = value.cast<py::array>();
    if (!py::isinstance<Array<float>>(array)) throw std::invalid_argument(std::string("_core: wrong dtype of ") + name);
    const auto count = static_cast<std::size_t>(array.size());
    layers.push_back(rows_of<T>(std::span{static_cast<const float*>(array.data()), count}));
  }
}

// Reads the instructions of each program, as the Python layer wrote them.
void read_programs(const py::dict& values, Appearance& appearance) {
  const auto instance_values = get<std::size_t>(values, "instance_value_count");
  for (const py::handle value : values["programs"]) {
    const auto program = value.cast<py::dict>();
    appearance.programs.push_back(std::make_shared<NodeProgram>(view<std::int32_t>(program, "codes"),
                                                                view<float>(program, "numbers"),
                                                                appearance.images.size(), instance_values));
  }
  appearance.material_programs = view<std::int32_t>(values, "material_programs");
  appearance.instance_values = rows_of<Rgba>(view<float>(values, "instance_values"));
}

}  // namespace

void read_appearance(const py::dict& values, Appearance& appearance) {
  appearance.base_colors = rows_of<Vec3f>(view<float>(values, "base_colors"));
  appearance.emissions = rows_of<Vec3f>(view<float>(values, "emissions"));
  appearance.alphas = view<float>(values, "alphas");
  appearance.metallics = view<float>(values, "metallics");
  appearance.roughnesses = view<float>(values, "roughnesses");
  appearance.lossy_facets = view<float>(values, "lossy_facets");
  appearance.reflectances = view<float>(values, "reflectances");
  appearance.transmissions = view<float>(values, "transmissions");
  appearance.translucencies = view<float>(values, "translucencies");
  appearance.iors = view<float>(values, "iors");
  appearance.even_metals = view<float>(values, "even_metals");
  appearance.tinted_glasses = view<float>(values, "tinted_glasses");
  appearance.plain_refractions = view<float>(values, "plain_refractions");
  appearance.specular_tints = rows_of<Vec3f>(view<float>(values, "specular_tints"));
  const auto read_tints = [&](const char* colors, const char* powers) {
    return TintTable{rows_of<Vec3f>(view<float>(values, colors)), view<float>(values, powers)};
  };
  appearance.metal_tints = read_tints("metal_colors", "metal_powers");
  appearance.transmission_tints = read_tints("transmission_colors", "transmission_powers");
  appearance.translucent_tints = read_tints("translucent_colors", "translucent_powers");
  appearance.material_holdouts = view<float>(values, "holdouts");
  appearance.hairs = view<std::int32_t>(values, "hairs");
  read_hair(values["hair"].cast<py::dict>(), appearance.hair_rows);
  appearance.finishes = view<std::int32_t>(values, "finishes");
  appearance.finish_rows = rows_of<Finish>(view<float>(values, "finish"));
  read_scene_light(values, appearance);
  read_programs(values, appearance);
  appearance.material_colors = rows_of<Rgba>(view<float>(values, "material_colors"));
  appearance.material_pass_indices = view<std::int32_t>(values, "material_indices");
  appearance.instance_ids = view<std::int32_t>(values, "instance_ids");
  appearance.slot_offsets = view<std::int32_t>(values, "slot_offsets");
  appearance.slot_materials = view<std::int32_t>(values, "slot_materials");
  appearance.object_pass_indices = view<std::int32_t>(values, "object_indices");
  appearance.holdout = rows_of<std::uint8_t>(view<bool>(values, "holdout"));
  appearance.camera_mask = get<std::uint32_t>(values, "camera_mask");
  appearance.shadow_mask = get<std::uint32_t>(values, "shadow_mask");
  appearance.diffuse_mask = get<std::uint32_t>(values, "diffuse_mask");
  appearance.glossy_mask = get<std::uint32_t>(values, "glossy_mask");
  appearance.transmission_mask = get<std::uint32_t>(values, "transmission_mask");
  appearance.catcher_mask = get<std::uint32_t>(values, "catcher_mask");
  appearance.film_transparent = get<bool>(values, "film_transparent");
  appearance.plain_reflectance = get<float>(values, "plain_reflectance");
  appearance.pass_alpha_threshold = get<float>(values, "pass_alpha_threshold");
  for (const auto& [key, value] : values["meshes"].cast<py::dict>()) {
    const auto mesh = value.cast<py::dict>();
    MeshAttributes attributes;
    if (mesh.contains("material_slots")) attributes.material_slots = view<std::int32_t>(mesh, "material_slots");
    if (mesh.contains("corner_normals"))
      attributes.corner_normals = rows_of<Vec3f>(view<float>(mesh, "corner_normals"));
    read_layers(mesh, "uv_maps", attributes.uv_maps);
    read_layers(mesh, "corner_colors", attributes.corner_colors);
    read_layers(mesh, "corner_tangents", attributes.corner_tangents);
    read_layers(mesh, "corner_generated", attributes.generated);
    if (mesh.contains("texture_space")) {
      const auto rows = rows_of<Vec3f>(view<float>(mesh, "texture_space"));
      attributes.generated_scale = rows[0], attributes.generated_offset = rows[1];
    }
    if (mesh.contains("curve_offsets")) attributes.curve_offsets = view<std::int64_t>(mesh, "curve_offsets");
    appearance.set_mesh(key.cast<std::int32_t>(), attributes);
  }
  appearance.finish();
}

namespace {

// Returns the memory of a pass, one row per pixel; empty if the pass is not wanted.
template <class T, class Scalar>
std::span<T> target(const py::dict& targets, const char* name, std::size_t pixel_count) {
  if (!targets.contains(name)) return {};
  auto array = targets[name].cast<py::array>();
  constexpr std::size_t kWidth = sizeof(T) / sizeof(Scalar);
  if (!py::isinstance<Array<Scalar>>(array) || static_cast<std::size_t>(array.size()) != pixel_count * kWidth ||
      !array.writeable()) {
    throw std::invalid_argument(std::string("_core: pass ") + name + " has the wrong dtype, size or flags");
  }
  return {static_cast<T*>(array.mutable_data()), pixel_count};
}

PassTargets read_targets(const py::dict& arrays, std::size_t pixel_count) {
  using Integer = std::int32_t;
  PassTargets targets;
  targets.combined = target<Rgba, float>(arrays, "combined", pixel_count);
  targets.depth = target<float, float>(arrays, "depth", pixel_count);
  targets.distance = target<float, float>(arrays, "distance", pixel_count);
  targets.normal = target<Vec3f, float>(arrays, "normal", pixel_count);
  targets.object_index = target<Integer, Integer>(arrays, "object_index", pixel_count);
  targets.material_index = target<Integer, Integer>(arrays, "material_index", pixel_count);
  targets.instance = target<Integer, Integer>(arrays, "instance", pixel_count);
  targets.primitive = target<Integer, Integer>(arrays, "primitive", pixel_count);
  targets.vector = target<PixelMotion, float>(arrays, "vector", pixel_count);
  targets.nodes_visited = target<Integer, Integer>(arrays, "nodes_visited", pixel_count);
  targets.denoising_color = target<Rgba, float>(arrays, "denoising_color", pixel_count);
  targets.denoising_albedo = target<Vec3f, float>(arrays, "denoising_albedo", pixel_count);
  targets.denoising_normal = target<Vec3f, float>(arrays, "denoising_normal", pixel_count);
  targets.primitives_tested = target<Integer, Integer>(arrays, "primitives_tested", pixel_count);
  return targets;
}

// Returns the columns that Snapshot.audit_answers takes, and the pixel that each ray belongs to.
py::dict columns_of(const std::vector<SubsetRay>& kept, int width) {
  const auto count = static_cast<py::ssize_t>(kept.size());
  py::array_t<std::int64_t> pixels(count);
  py::array_t<double> origins({count, py::ssize_t{3}}), directions({count, py::ssize_t{3}});
  py::array_t<float> t_min(count), t_max(count), t_hit(count), times(count);
  py::array_t<std::uint32_t> masks(count);
  py::array_t<std::int32_t> instance_ids(count), primitive_ids(count);
  for (py::ssize_t row = 0; row < count; ++row) {
    const SubsetRay& item = kept[static_cast<std::size_t>(row)];
    pixels.mutable_at(row) = std::int64_t{item.pixel.y} * width + item.pixel.x;
    for (int axis = 0; axis < 3; ++axis) {
      origins.mutable_at(row, axis) = item.ray.origin[axis];
      directions.mutable_at(row, axis) = item.ray.direction[axis];
    }
    t_min.mutable_at(row) = item.ray.t_min, t_max.mutable_at(row) = item.ray.t_max;
    times.mutable_at(row) = item.ray.time;
    masks.mutable_at(row) = item.ray.mask, t_hit.mutable_at(row) = item.t;
    instance_ids.mutable_at(row) = item.instance_id, primitive_ids.mutable_at(row) = item.primitive_id;
  }
  py::dict columns;
  columns["pixels"] = pixels, columns["origins"] = origins, columns["directions"] = directions;
  columns["t_min"] = t_min, columns["t_max"] = t_max, columns["masks"] = masks, columns["times"] = times,
  columns["t_hit"] = t_hit;
  columns["instance_ids"] = instance_ids, columns["primitive_ids"] = primitive_ids;
  return columns;
}

py::dict render_passes(const Snapshot& snapshot, const py::dict& camera_values, const py::dict& appearance_values,
                       const py::dict& settings_values, const py::dict& arrays, const py::object& progress) {
  const RenderSettings settings = read_settings(settings_values);
  const Camera camera = read_camera(camera_values);
  Appearance appearance;
  read_appearance(appearance_values, appearance);
  appearance.view.emplace(View{RayMaker(camera, settings.width, settings.height), static_cast<double>(settings.width),
                               static_cast<double>(settings.height)});
  if (settings.shutter) appearance.frame_time = settings.shutter->frame_time;
  const auto pixel_count = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height);
  const PassTargets targets = read_targets(arrays, pixel_count);
  const std::vector<SubsetRay> kept = with_progress(
      progress, [&](CancelToken& cancel) { return render(snapshot, camera, appearance, settings, targets, cancel); });
  return columns_of(kept, settings.width);
}

std::shared_ptr<BrightSky> make_bright_sky(const py::dict& values, int threads) {
  const Texture image = read_image(values);
  const py::gil_scoped_release release;
  return std::make_shared<BrightSky>(image, threads);
}

Array<float> cost_colors(const Array<float>& costs) {
  const ColorRamp ramp;
  Array<float> colors({costs.size(), py::ssize_t{3}});
  for (py::ssize_t i = 0; i < costs.size(); ++i) {
    const Vec3f color = cost_color(ramp, costs.data()[i]);
    std::copy_n(&color.x, 3, colors.mutable_data() + 3 * i);
  }
  return colors;
}

}  // namespace

void bind_render(py::module_& module) {
  const py::class_<BrightSky, std::shared_ptr<BrightSky>> bright_sky(module, "BrightSky");
  make_only_natively(bright_sky);
  module.def("make_bright_sky", &make_bright_sky, py::arg("image"), py::arg("threads"));
  module.def("cost_colors", &cost_colors, py::arg("costs").noconvert());
  module.def("render", &render_passes, py::arg("snapshot"), py::arg("camera"), py::arg("appearance"),
             py::arg("settings"), py::arg("targets"), py::arg("progress"));
}

}  // namespace perfect_bvh::bindings
