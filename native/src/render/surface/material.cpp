// The materials of hits, from rows of tables and programs of nodes.
#include <algorithm>
#include <cmath>

#include "math/elementary.h"
#include "render/surface/hit_inputs.h"
#include "render/surface/surface.h"

namespace perfect_bvh {
namespace {

constexpr float kPlainRoughness = 0.5f;
constexpr float kLeastIor = 1e-5f, kLeastStretch = 1e-2f;

// The last two arguments are the default for an empty table.
Vec3f tinted(const TintTable& table, std::size_t row, Vec3f base, Vec3f color, float power) noexcept {
  if (!table.colors.empty()) color = table.colors[row];
  if (!table.powers.empty()) power = table.powers[row];
  if (power == 0.0f) return color;
  if (power == 1.0f) return color * base;
  const auto raised = [power](float channel) { return perfect_bvh::power(std::max(channel, 0.0f), power); };
  return color * Vec3f{raised(base.x), raised(base.y), raised(base.z)};
}

void set_scattering(const Appearance& appearance, std::size_t index, Material& material) {
  const auto set = [index]<class T>(std::span<const T> column, T& value) {
    if (!column.empty()) value = column[index];
  };
  set(appearance.metallics, material.metallic), set(appearance.roughnesses, material.roughness);
  set(appearance.lossy_facets, material.lossy_facets);
  set(appearance.reflectances, material.reflectance), set(appearance.specular_tints, material.specular_tint);
  set(appearance.transmissions, material.transmission), set(appearance.iors, material.ior);
  set(appearance.even_metals, material.even_metal), set(appearance.tinted_glasses, material.tinted_glass);
  set(appearance.plain_refractions, material.plain_refraction);
  set(appearance.translucencies, material.translucency);
  material.metal = tinted(appearance.metal_tints, index, material.color, {1, 1, 1}, 1.0f);
  if (material.transmission > 0.0f) {
    material.tint = tinted(appearance.transmission_tints, index, material.color, {1, 1, 1}, 0.5f);
  }
  material.translucent = tinted(appearance.translucent_tints, index, material.color, {0, 0, 0}, 0.0f);
}

// Reads the base from tables; the rest depends on its colour.
Material base_of(const Appearance& appearance, std::int32_t row) noexcept {
  Material material;
  material.color = material_color(appearance, row);
  if (row == kNoMaterial) {
    material.reflectance = appearance.plain_reflectance, material.roughness = kPlainRoughness;
    return material;
  }
  const auto index = static_cast<std::size_t>(row);
  if (!appearance.base_colors.empty()) material.color = appearance.base_colors[index];
  if (!appearance.emissions.empty()) material.emission = appearance.emissions[index];
  if (!appearance.alphas.empty()) material.alpha = appearance.alphas[index];
  if (!appearance.material_holdouts.empty()) material.holdout = appearance.material_holdouts[index];
  return material;
}

void set_rest(const Appearance& appearance, std::int32_t row, Material& material) {
  if (row == kNoMaterial) return;
  const auto index = static_cast<std::size_t>(row);
  set_scattering(appearance, index, material);
  if (!appearance.hairs.empty() && appearance.hairs[index] != kNoHair) {
    material.hair = &appearance.hair_rows[static_cast<std::size_t>(appearance.hairs[index])];
  }
  if (!appearance.finishes.empty() && appearance.finishes[index] != kNoFinish) {
    material.finish = appearance.finish_rows[static_cast<std::size_t>(appearance.finishes[index])];
  }
}

float in_unit(float value) noexcept { return value > 0.0f ? std::min(value, 1.0f) : 0.0f; }
// Light that is negative or NaN becomes zero.
Vec3f as_light(Vec3f color) noexcept {
  const auto kept = [](float value) { return value > 0.0f && std::isfinite(value) ? value : 0.0f; };
  return {kept(color.x), kept(color.y), kept(color.z)};
}

// The results of one hit's nodes.
class ProgramValues {
 public:
  ProgramValues(const NodeProgram& program, const NodeRun& run, std::size_t lane) noexcept
      : program_(program), run_(run), lane_(lane) {}

  void set_share(MaterialSlot slot, float& value) const noexcept {
    if (const NodeOperand* const operand = program_.output(slot)) value = in_unit(run_.number(*operand, lane_));
  }
  void set_color(MaterialSlot slot, Vec3f& value) const noexcept {
    if (const NodeOperand* const operand = program_.output(slot)) value = as_light(run_.vector(*operand, lane_));
  }
  // least: the result is above 0, and at least this.
  void set_number(MaterialSlot slot, float least, float& value) const noexcept {
    const NodeOperand* const operand = program_.output(slot);
    if (operand == nullptr) return;
    const float number = run_.number(*operand, lane_);
    value = number > 0.0f && std::isfinite(number) ? std::max(number, least) : value;
  }
  void set_direction(MaterialSlot slot, Vec3f& value) const noexcept {
    const NodeOperand* const operand = program_.output(slot);
    if (operand == nullptr) return;
    const Vec3f direction = run_.vector(*operand, lane_);
    const float size = length(direction);
    if (size > 0.0f && std::isfinite(size)) value = direction * (1.0f / size);
  }
  void set_normal(SurfacePoint& point) const noexcept {
    Vec3f normal{0, 0, 0};
    set_direction(MaterialSlot::kNormal, normal);
    if (!(normal == Vec3f{0, 0, 0})) point.normal = point.light_normal = normal;
  }
  void set_finish(Material& material) const noexcept {
    if (!material.finish) return;
    Finish& finish = *material.finish;
    set_color(MaterialSlot::kSheen, finish.sheen), set_share(MaterialSlot::kSheenRoughness, finish.sheen_roughness);
    set_share(MaterialSlot::kCoat, finish.coat), set_share(MaterialSlot::kCoatRoughness, finish.coat_roughness);
    set_number(MaterialSlot::kCoatIor, 1.0f, finish.coat_ior), set_color(MaterialSlot::kCoatTint, finish.coat_tint);
    set_number(MaterialSlot::kStretch, kLeastStretch, finish.stretch);
    if (const NodeOperand* const operand = program_.output(MaterialSlot::kRotation)) {
      const float turns = run_.number(*operand, lane_);
      finish.rotation = std::isfinite(turns) ? turns : 0.0f;
    }
    set_share(MaterialSlot::kDiffuseRoughness, finish.diffuse_roughness);
    set_direction(MaterialSlot::kTangent, material.tangent),
        set_direction(MaterialSlot::kCoatNormal, material.coat_normal);
  }

 private:
  const NodeProgram& program_;
  const NodeRun& run_;
  std::size_t lane_;
};

void finish_material(const Appearance& appearance, std::int32_t row, const ProgramValues& values, Material& material) {
  values.set_color(MaterialSlot::kColor, material.color);
  values.set_color(MaterialSlot::kEmission, material.emission);
  values.set_share(MaterialSlot::kAlpha, material.alpha);
  set_rest(appearance, row, material);
  values.set_share(MaterialSlot::kRoughness, material.roughness);
  values.set_share(MaterialSlot::kMetallic, material.metallic);
  values.set_color(MaterialSlot::kMetal, material.metal);
  values.set_share(MaterialSlot::kReflectance, material.reflectance);
  values.set_color(MaterialSlot::kSpecularTint, material.specular_tint);
  values.set_share(MaterialSlot::kTransmission, material.transmission);
  values.set_number(MaterialSlot::kIor, kLeastIor, material.ior);
  values.set_color(MaterialSlot::kTint, material.tint);
  values.set_share(MaterialSlot::kTranslucency, material.translucency);
  values.set_color(MaterialSlot::kTranslucent, material.translucent);
  values.set_finish(material);
}

Material material_of_table(const Appearance& appearance, std::int32_t row) {
  Material material = base_of(appearance, row);
  set_rest(appearance, row, material);
  return material;
}

}  // namespace

std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t map) {
  return layer_at(appearance, instance, hit, &MeshAttributes::uv_maps, map);
}

Ray ray_onto(const Snapshot& snapshot, const Hit& hit, float time) noexcept {
  const Instance& instance = snapshot.instances[hit.instance_index];
  Ray ray;
  ray.time = time;
  Vec3d normal{0, 0, 1}, position = instance.object_to_world.translation;
  if (!instance.blas->mesh.is_round()) {
    const Vec3d outer = normalized(world_triangle(snapshot, hit, time).scaled_normal());
    position = hit_position(snapshot, hit, time);
    if (!(outer == Vec3d{0, 0, 0})) normal = outer;
  }
  ray.origin = position + normal, ray.direction = -normal;
  return ray;
}

namespace {

// Evaluates one hit.
const NodeRun& run_alone(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit,
                         const NodeProgram& program, const NodePart& part) {
  static thread_local NodeRun run;
  static thread_local AlignedVector<SurfacePoint> points;
  points.clear();
  if (part.needs.points) {
    find_surfaces(snapshot, appearance, {.normals = true, .holdouts = true}, {&ray, 1}, {&hit, 1}, points);
  }
  if (points.empty()) points.emplace_back();
  HitInputs inputs(appearance);
  inputs.add(snapshot.instances[hit.instance_index], ray, hit, points.front());
  inputs.prepare(part.needs);
  run.run(program, part, appearance.images, inputs, 1);
  return run;
}

}  // namespace

Material material_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit,
                     std::int32_t row) {
  const NodeProgram* const program = appearance.program_of(row);
  if (program == nullptr) return material_of_table(appearance, row);
  const NodeRun& run = run_alone(snapshot, appearance, ray, hit, *program, program->whole());
  Material material = base_of(appearance, row);
  finish_material(appearance, row, ProgramValues(*program, run, 0), material);
  return material;
}

float alpha_at(const Snapshot& snapshot, const Appearance& appearance, const Ray& ray, const Hit& hit,
               std::int32_t row) {
  float alpha =
      row == kNoMaterial || appearance.alphas.empty() ? 1.0f : appearance.alphas[static_cast<std::size_t>(row)];
  const NodeProgram* const program = appearance.program_of(row);
  if (program == nullptr || program->alpha().instructions.empty()) return alpha;
  const NodeRun& run = run_alone(snapshot, appearance, ray, hit, *program, program->alpha());
  ProgramValues(*program, run, 0).set_share(MaterialSlot::kAlpha, alpha);
  return alpha;
}

std::span<Material> MaterialReader::read(const Snapshot& snapshot, const Appearance& appearance,
                                         std::span<const Ray> rays, std::span<const Hit> hits,
                                         std::span<SurfacePoint> points) {
  materials_.resize(points.size()), order_.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (appearance.program_of(points[i].material) == nullptr) {
      materials_[i] = material_of_table(appearance, points[i].material);
    } else {
      order_.push_back(static_cast<std::uint32_t>(i));
    }
  }
  std::stable_sort(order_.begin(), order_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return points[a].material < points[b].material; });
  HitInputs inputs(appearance);
  for (std::size_t first = 0; first < order_.size();) {
    const std::int32_t row = points[order_[first]].material;
    const NodeProgram& program = *appearance.program_of(row);
    inputs.clear();
    std::size_t last = first;
    for (; last < order_.size() && points[order_[last]].material == row && inputs.count() < kNodeLanes; ++last) {
      SurfacePoint& point = points[order_[last]];
      point.light_normal = point.mesh_normal;  // resets the normal before it is bent again
      inputs.add(snapshot.instances[hits[point.ray].instance_index], rays[point.ray], hits[point.ray], point);
    }
    inputs.prepare(program.whole().needs);
    run_.run(program, program.whole(), appearance.images, inputs, inputs.count());
    for (std::size_t lane = 0; first < last; ++first, ++lane) {
      const ProgramValues values(program, run_, lane);
      Material& material = materials_[order_[first]] = base_of(appearance, row);
      finish_material(appearance, row, values, material);
      values.set_normal(points[order_[first]]);
    }
  }
  return materials_;
}

}  // namespace perfect_bvh
