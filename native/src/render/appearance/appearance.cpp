#include "render/appearance/appearance.h"

#include <algorithm>
#include <string>

#include "core/errors.h"
#include "mesh/round_mesh.h"

namespace perfect_bvh {
namespace {

void require(bool condition, const std::string& complaint) {
  if (!condition) throw InvalidArgument("render: appearance." + complaint);
}

void set_row(std::vector<std::int32_t>& rows, std::int32_t id, std::size_t row) {
  const auto index = static_cast<std::size_t>(id);
  if (index >= rows.size()) rows.resize(std::max(index + 1, rows.size() * 3 / 2), -1);
  rows[index] = static_cast<std::int32_t>(row);
}

}  // namespace

void Appearance::set_mesh(std::int32_t mesh_id, const MeshAttributes& attributes) {
  require(mesh_id >= 0, "meshes has the key " + std::to_string(mesh_id) + "; mesh ids are 0 or more");
  const auto offsets = attributes.curve_offsets;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    // What came before is not negative, so the difference of what is larger is none that overflows.
    if (i == 0 ? offsets[0] == 0 : offsets[i] > offsets[i - 1] && offsets[i] - offsets[i - 1] >= 2) continue;
    require(false, "meshes[" + std::to_string(mesh_id) + "].curve_offsets must rise from 0 by 2 or more, got " +
                       std::to_string(offsets[i]) + " in row " + std::to_string(i));
  }
  set_row(mesh_rows_, mesh_id, meshes_.size());
  meshes_.push_back(attributes);
}

void Appearance::finish() {
  check_tables();
  if (!instance_ids.empty()) {
    const auto largest = static_cast<std::size_t>(*std::max_element(instance_ids.begin(), instance_ids.end()));
    instance_rows_.assign(largest + 1, -1);
  }
  for (std::size_t row = 0; row < instance_ids.size(); ++row) {
    instance_rows_[static_cast<std::size_t>(instance_ids[row])] = static_cast<std::int32_t>(row);
  }
  const auto is_below_one = [](float alpha) { return alpha < 1.0f; };
  const auto is_above_zero = [](float share) { return share > 0.0f; };
  any_transparent_ = std::any_of(alphas.begin(), alphas.end(), is_below_one) ||
                     std::any_of(alpha_images.begin(), alpha_images.end(), [](auto image) { return image >= 0; });
  any_holdout_ = std::any_of(holdout.begin(), holdout.end(), [](std::uint8_t flag) { return flag != 0; }) ||
                 std::any_of(material_holdouts.begin(), material_holdouts.end(), is_above_zero);
}

bool Appearance::is_hole(std::int32_t material) const noexcept {
  if (material == kNoMaterial) return false;
  const auto row = static_cast<std::size_t>(material);
  return material_holdouts[row] >= 1.0f && (alphas.empty() || alphas[row] >= 1.0f) &&
         (alpha_images.empty() || alpha_images[row] == kNoImage);
}

void Appearance::check_tables() const {
  const std::size_t count = instance_ids.size();
  const auto rows = [count](std::size_t size) {
    return " has " + std::to_string(size) + " rows but instances.ids has " + std::to_string(count);
  };
  require(object_pass_indices.size() == count, "instances.object_indices" + rows(object_pass_indices.size()));
  require(holdout.size() == count, "instances.holdout" + rows(holdout.size()));
  require(slot_offsets.size() == count + 1,
          "instances.slot_offsets" + rows(slot_offsets.size()) + " (it needs one row more)");
  require(std::all_of(instance_ids.begin(), instance_ids.end(), [](std::int32_t id) { return id >= 0; }),
          "instances.ids holds a negative id");
  require(slot_offsets.front() >= 0 && std::is_sorted(slot_offsets.begin(), slot_offsets.end()) &&
              static_cast<std::size_t>(slot_offsets.back()) <= slot_materials.size(),
          "instances.slot_offsets must rise from 0 to at most the " + std::to_string(slot_materials.size()) +
              " rows of instances.slot_materials");
  require(material_pass_indices.size() == material_colors.size(),
          "materials.indices has " + std::to_string(material_pass_indices.size()) + " rows but materials.colors has " +
              std::to_string(material_colors.size()));
  check_materials();
  const auto material_count = static_cast<std::int32_t>(material_colors.size());
  const auto wrong = std::find_if(slot_materials.begin(), slot_materials.end(), [=](std::int32_t material) {
    return material < kNoMaterial || material >= material_count;
  });
  if (wrong != slot_materials.end()) {
    require(false, "instances.slot_materials[" + std::to_string(wrong - slot_materials.begin()) +
                       "] refers to material " + std::to_string(*wrong) + " but materials.colors has " +
                       std::to_string(material_count) + " rows");
  }
}

void Appearance::check_materials() const {
  const std::size_t count = material_colors.size();
  const auto check = [count](const char* name, std::size_t rows) {
    require(rows == 0 || rows == count, std::string("materials.") + name + " has " + std::to_string(rows) +
                                            " rows but materials.colors has " + std::to_string(count));
  };
  check("base_colors", base_colors.size());
  check("emissions", emissions.size());
  check("alphas", alphas.size());
  check("metallics", metallics.size());
  check("roughnesses", roughnesses.size());
  check("lossy_facets", lossy_facets.size());
  check("reflectances", reflectances.size());
  check("transmissions", transmissions.size());
  check("translucencies", translucencies.size());
  check("iors", iors.size());
  check("even_metals", even_metals.size());
  check("tinted_glasses", tinted_glasses.size());
  check("plain_refractions", plain_refractions.size());
  check("specular_tints", specular_tints.size());
  check("metal_colors", metal_tints.colors.size());
  check("metal_powers", metal_tints.powers.size());
  check("transmission_colors", transmission_tints.colors.size());
  check("transmission_powers", transmission_tints.powers.size());
  check("translucent_colors", translucent_tints.colors.size());
  check("translucent_powers", translucent_tints.powers.size());
  check("holdouts", material_holdouts.size());
  check("color_scales", color_scales.size());
  check("tints", tints.size());
  check("hairs", hairs.size());
  for (const std::int32_t row : hairs) {
    require(
        row >= kNoHair && row < static_cast<std::int32_t>(hair_rows.size()),
        "materials.hairs refers to row " + std::to_string(row) + " but hair has " + std::to_string(hair_rows.size()));
  }
  const auto check_images = [&](const char* name, std::span<const std::int32_t> rows) {
    check(name, rows.size());
    for (const std::int32_t row : rows) {
      require(row >= kNoImage && row < static_cast<std::int32_t>(images.size()),
              std::string("materials.") + name + " refers to image " + std::to_string(row) + " but there are " +
                  std::to_string(images.size()));
    }
  };
  check_images("color_images", color_images);
  check_images("alpha_images", alpha_images);
  check_images("emission_images", emission_images);
  const auto check_world = [&](const char* name, const std::optional<World>& shown) {
    require(!shown || (shown->image >= kNoImage && shown->image < static_cast<std::int32_t>(images.size())),
            std::string(name) + ".image is " + std::to_string(shown ? shown->image : 0) + " but there are " +
                std::to_string(images.size()) + " images");
  };
  check_world("world", world);
  check_world("backdrop", backdrop);
}

void Appearance::check_fits(const Instance& instance, const MeshAttributes& attributes) const {
  if (instance.blas->mesh.is_round()) return check_fits_round(instance, attributes);
  const std::size_t count = instance.blas->mesh.primitive_count();
  const auto check = [&](std::size_t rows, const char* name) {
    if (rows == 0 || rows == count) return;
    const std::string mesh = "meshes[" + std::to_string(instance.mesh_id) + "].";
    require(false, mesh + name + " has " + std::to_string(rows) + " rows but the mesh has " + std::to_string(count) +
                       " triangles; read the mesh's attributes again after it changes");
  };
  check(attributes.material_slots.size(), "material_slots");
  check(attributes.corner_normals.size() / 3, "corner_normals");
  for (const auto& map : attributes.uv_maps) check(map.size() / 3, "corner_uvs");
  for (const auto& colors : attributes.corner_colors) check(colors.size() / 3, "corner_colors");
}

void Appearance::check_fits_round(const Instance& instance, const MeshAttributes& attributes) {
  const Mesh& mesh = instance.blas->mesh;
  const std::size_t count = given_part_count(mesh);
  const bool is_curves = mesh.kind == PrimitiveKind::kCurves;
  const auto check = [&](std::size_t rows, const char* name, std::size_t other) {
    if (rows == 0 || rows == count || rows == other) return;
    std::string expected = std::to_string(count) + (is_curves ? " curves" : " points");
    if (other != count) expected += " and " + std::to_string(other) + " control points";
    require(false, "meshes[" + std::to_string(instance.mesh_id) + "]." + name + " has " + std::to_string(rows) +
                       " rows but the mesh has " + expected + "; read the mesh's attributes again after it changes");
  };
  const auto offsets = attributes.curve_offsets;
  if (!offsets.empty()) check(offsets.size() - 1, "curve_offsets", count);
  const std::size_t points = offsets.empty() || !is_curves ? count : static_cast<std::size_t>(offsets.back());
  check(attributes.material_slots.size(), "material_slots", count);
  for (const auto& map : attributes.uv_maps) check(map.size(), "corner_uvs", points);
  for (const auto& colors : attributes.corner_colors) check(colors.size(), "corner_colors", points);
}

std::int32_t Appearance::material_of(const Instance& instance, std::uint32_t primitive) const {
  const auto row = row_of(instance);
  if (row < 0) return kNoMaterial;
  const auto first = slot_offsets[static_cast<std::size_t>(row)];
  const auto count = slot_offsets[static_cast<std::size_t>(row) + 1] - first;
  if (count == 0) return kNoMaterial;
  std::int32_t slot = 0;
  if (const auto* attributes = attributes_of(instance); attributes && !attributes->material_slots.empty()) {
    check_fits(instance, *attributes);
    const Mesh& mesh = instance.blas->mesh;
    slot = attributes->material_slots[mesh.is_round() ? caller_number(mesh, primitive) : primitive];
  }
  // A triangle may name a slot that its object lacks: as in Blender, the last one then counts.
  return slot_materials[static_cast<std::size_t>(first + std::clamp(slot, 0, count - 1))];
}

}  // namespace perfect_bvh
