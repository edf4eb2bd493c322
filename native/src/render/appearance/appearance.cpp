#include "render/appearance/appearance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>

#include "core/errors.h"
#include "math/elementary.h"
#include "mesh/round_mesh.h"

namespace perfect_bvh {
namespace {

// IEC 61966-2-1.
float linear_of(int byte) noexcept {
  const float value = static_cast<float>(byte) / 255.0f;
  return value <= 0.04045f ? value / 12.92f : power((value + 0.055f) / 1.055f, 2.4f);
}

const std::array<float, 256>& linear_values() noexcept {
  static const std::array<float, 256> values = [] {
    std::array<float, 256> made{};
    for (int byte = 0; byte < 256; ++byte) made[static_cast<std::size_t>(byte)] = linear_of(byte);
    return made;
  }();
  return values;
}

// Returns a pixel's number along one side; -1 outside a clipped image.
int place(int number, int count, Extension extension) noexcept {
  if (number >= 0 && number < count) return number;
  if (extension == Extension::kClip) return -1;
  if (extension == Extension::kExtend) return number < 0 ? 0 : count - 1;
  if (extension == Extension::kMirror) {
    const int at = number % (2 * count), turned = at < 0 ? at + 2 * count : at;
    return turned < count ? turned : 2 * count - 1 - turned;
  }
  const int rest = number % count;
  return rest < 0 ? rest + count : rest;
}

// Converts a value between bytes, which is sRGB as in Cycles: within 6e-6, and exact for byte values.
float linear_between(float value) noexcept {
  const auto& linear = linear_values();
  const int byte = std::min(static_cast<int>(value), 254);
  const float low = linear[static_cast<std::size_t>(byte)], high = linear[static_cast<std::size_t>(byte) + 1];
  return low + (high - low) * (value - static_cast<float>(byte));
}

bool is_srgb(const Texture& texture) noexcept { return texture.bytes != nullptr && !texture.is_linear; }

// Bytes of sRGB are used as stored; linear bytes are scaled to their range.
Rgba pixel_of(const Texture& texture, int x, int y) noexcept {
  const std::size_t first =
      4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(texture.width) + static_cast<std::size_t>(x));
  if (texture.floats != nullptr) {
    const float* const pixel = texture.floats + first;
    return {pixel[0], pixel[1], pixel[2], pixel[3]};
  }
  const float unit = texture.is_linear ? 1.0f / 255.0f : 1.0f;
  const auto at = [&](std::size_t channel) { return static_cast<float>(texture.bytes[first + channel]) * unit; };
  return {at(0), at(1), at(2), at(3)};
}

// Converts a stored or interpolated value.
Rgba linear_pixel(const Texture& texture, const Rgba& found) noexcept {
  if (!is_srgb(texture)) return found;
  return {linear_between(found.r), linear_between(found.g), linear_between(found.b), found.a / 255.0f};
}

Rgba pixel_at(const Texture& texture, Extension extension, int x, int y) noexcept {
  x = place(x, texture.width, extension), y = place(y, texture.height, extension);
  return x < 0 || y < 0 ? Rgba{} : pixel_of(texture, x, y);
}

Rgba mixed(const Rgba& a, const Rgba& b, float share) noexcept {
  return {a.r + (b.r - a.r) * share, a.g + (b.g - a.g) * share, a.b + (b.b - a.b) * share, a.a + (b.a - a.a) * share};
}

// Clamps a coordinate in pixels to the range of an integer; NaN becomes 0.
float in_pixels(float coordinate, int count, Extension extension) noexcept {
  if (!std::isfinite(coordinate)) return 0.0f;
  if (extension == Extension::kRepeat) coordinate -= std::floor(coordinate);
  if (extension == Extension::kMirror) coordinate -= 2.0f * std::floor(coordinate * 0.5f);
  return std::clamp(coordinate, -2.0f, 3.0f) * static_cast<float>(count) - 0.5f;
}

Rgba look_up(const Texture& texture, Extension extension, float u, float v) noexcept {
  if (texture.width == 0 || texture.height == 0) return {};
  const float x = in_pixels(u, texture.width, extension);
  const float y = in_pixels(v, texture.height, extension);
  const float left = std::floor(x), below = std::floor(y);
  const int column = static_cast<int>(left), row = static_cast<int>(below);
  const auto pixel = [&](int right, int above) { return pixel_at(texture, extension, column + right, row + above); };
  if (texture.is_closest) {
    const bool is_right = x - left >= 0.5f, is_above = y - below >= 0.5f;
    return linear_pixel(texture, pixel(is_right ? 1 : 0, is_above ? 1 : 0));
  }
  const Rgba lower = mixed(pixel(0, 0), pixel(1, 0), x - left);
  const Rgba upper = mixed(pixel(0, 1), pixel(1, 1), x - left);
  return linear_pixel(texture, mixed(lower, upper, y - below));
}

constexpr Rgba kMissingTile{1.0f, 0.0f, 1.0f, 1.0f};

// As in Cycles, positions less than a unit to the left of all tiles, or below them, belong to the first ones.
Rgba look_up_tile(const TextureTiles& tiles, float u, float v) noexcept {
  const auto rows = static_cast<float>(tiles.rows.size() / TextureTiles::kColumns);
  if (!(u > -1.0f && u < TextureTiles::kColumns && v > -1.0f && v < rows)) return kMissingTile;
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const std::int32_t image = tiles.rows[static_cast<std::size_t>(row * TextureTiles::kColumns + column)];
  if (image < 0) return kMissingTile;
  const Texture& tile = tiles.images[static_cast<std::size_t>(image)];
  return look_up(tile, tile.extension, u - static_cast<float>(column), v - static_cast<float>(row));
}

}  // namespace

std::span<const Rgba> row_of_pixels(const Texture& texture, int y, std::vector<Rgba>& buffer) {
  const auto width = static_cast<std::size_t>(texture.width);
  const std::size_t first = 4 * static_cast<std::size_t>(y) * width;
  if (texture.floats != nullptr) return {reinterpret_cast<const Rgba*>(texture.floats + first), width};
  buffer.resize(width);
  if (!is_srgb(texture)) {
    for (std::size_t x = 0; x < width; ++x) buffer[x] = pixel_of(texture, static_cast<int>(x), y);
    return buffer;
  }
  const auto& linear = linear_values();
  for (std::size_t x = 0; x < width; ++x) {
    const std::uint8_t* const pixel = texture.bytes + first + 4 * x;
    buffer[x] = {linear[pixel[0]], linear[pixel[1]], linear[pixel[2]], static_cast<float>(pixel[3]) / 255.0f};
  }
  return buffer;
}

Rgba look_up(const Texture& texture, float u, float v) noexcept { return look_up(texture, texture.extension, u, v); }

Rgba look_up_tiled(const Texture& texture, float u, float v) noexcept {
  return texture.tiles ? look_up_tile(*texture.tiles, u, v) : look_up(texture, u, v);
}

Point2 place_around(Vec3f direction, bool is_sky) noexcept {
  constexpr double kPi = std::numbers::pi;
  const double x = static_cast<double>(direction.x), y = static_cast<double>(direction.y);
  const double around = arc_tangent(y, x),
               above = arc_tangent(static_cast<double>(direction.z), std::sqrt(x * x + y * y)) / kPi;
  const double up = is_sky ? std::copysign(std::sqrt(0.5 * std::abs(above)), above) : above;
  return {static_cast<float>(0.5 - around / (2.0 * kPi)), static_cast<float>(up + 0.5)};
}

Vec3f look_up_around(const Texture& texture, Vec3f direction) noexcept {
  const Point2 at = place_around(direction, texture.extension == Extension::kSky);
  // The image does not repeat over the poles.
  const float border = 0.5f / static_cast<float>(std::max(texture.height, 1));
  const Rgba color = look_up(texture, Extension::kRepeat, at.x, std::clamp(at.y, border, 1.0f - border));
  return {color.r, color.g, color.b};
}

// Appearance ----------------------------------------------------------------------------------------------------------

namespace {

void require(bool condition, const std::string& complaint) {
  if (!condition) throw InvalidArgument("render: appearance." + complaint);
}

void set_row(std::vector<std::int32_t>& rows, std::int32_t id, std::size_t row) {
  const auto index = static_cast<std::size_t>(id);
  if (index >= rows.size()) rows.resize(std::max(index + 1, rows.size() * 3 / 2), -1);
  rows[index] = static_cast<std::int32_t>(row);
}

bool sets_alpha(const NodeProgram* program) noexcept {
  return program != nullptr && program->output(MaterialSlot::kAlpha) != nullptr;
}

}  // namespace

void Appearance::set_mesh(std::int32_t mesh_id, const MeshAttributes& attributes) {
  require(mesh_id >= 0, "meshes has the key " + std::to_string(mesh_id) + "; mesh ids are 0 or more");
  const auto offsets = attributes.curve_offsets;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    // The previous offset is not negative, so the difference cannot overflow.
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
  const auto program_sets_alpha = [](const auto& program) { return sets_alpha(program.get()); };
  any_transparent_ = std::any_of(alphas.begin(), alphas.end(), is_below_one) ||
                     std::any_of(programs.begin(), programs.end(), program_sets_alpha);
  bends_normals_ = std::any_of(programs.begin(), programs.end(),
                               [](const auto& program) { return program->output(MaterialSlot::kNormal) != nullptr; });
  any_absorbing_ = std::any_of(finish_rows.begin(), finish_rows.end(),
                               [](const Finish& finish) { return !(finish.absorption == Vec3f{0, 0, 0}); });
  any_holdout_ = std::any_of(holdout.begin(), holdout.end(), [](std::uint8_t flag) { return flag != 0; }) ||
                 std::any_of(material_holdouts.begin(), material_holdouts.end(), is_above_zero);
}

Rgba Appearance::value_of(const Instance& instance, std::size_t number) const noexcept {
  const std::int32_t row = row_of(instance);
  if (row < 0) return {};
  const std::size_t width = instance_values.size() / instance_ids.size();
  return instance_values[static_cast<std::size_t>(row) * width + number];
}

bool Appearance::is_hole(std::int32_t material) const noexcept {
  if (material == kNoMaterial) return false;
  const auto row = static_cast<std::size_t>(material);
  return material_holdouts[row] >= 1.0f && (alphas.empty() || alphas[row] >= 1.0f) && !sets_alpha(program_of(material));
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
  const auto check_rows = [](const std::string& column, std::span<const std::int32_t> rows, const std::string& table,
                             std::size_t most) {
    for (const std::int32_t row : rows) {
      require(row >= -1 && row < static_cast<std::int32_t>(most), "materials." + column + " refers to row " +
                                                                      std::to_string(row) + " but " + table + " has " +
                                                                      std::to_string(most));
    }
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
  check("hairs", hairs.size());
  check_rows("hairs", hairs, "hair", hair_rows.size());
  check("finishes", finishes.size());
  check_rows("finishes", finishes, "finish", finish_rows.size());
  check("programs", material_programs.size());
  for (const std::int32_t row : material_programs) {
    require(row >= kNoProgram && row < static_cast<std::int32_t>(programs.size()),
            "materials.programs refers to program " + std::to_string(row) + " but there are " +
                std::to_string(programs.size()));
  }
  const auto check_world = [&](const char* name, const std::optional<World>& shown) {
    require(!shown || (shown->image >= kNoImage && shown->image < static_cast<std::int32_t>(images.size())),
            std::string(name) + ".image is " + std::to_string(shown ? shown->image : 0) + " but there are " +
                std::to_string(images.size()) + " images");
  };
  check_world("world", world);
  check_world("backdrop", backdrop);
}

void Appearance::check_fits(const Instance& instance, const MeshAttributes& attributes) const {
  const Mesh& mesh = instance.blas->mesh;
  const std::size_t count = part_count_of(mesh);
  const std::size_t corners = with_kind(mesh.kind, [](auto kind) { return kind.kCorners; });
  const auto check = [&](std::size_t rows, const char* name, std::size_t other) {
    if (rows == 0 || rows == count || rows == other) return;
    std::string expected = std::to_string(count) + " " + names_of(mesh.kind).kind;
    if (other != count) expected += " and " + std::to_string(other) + " control points";
    require(false, "meshes[" + std::to_string(instance.mesh_id) + "]." + name + " has " + std::to_string(rows) +
                       " rows but the mesh has " + expected + "; read the mesh's attributes again after it changes");
  };
  const auto offsets = attributes.curve_offsets;
  if (!offsets.empty() && corners == 1) check(offsets.size() - 1, "curve_offsets", count);
  const bool has_points = !offsets.empty() && mesh.kind == PrimitiveKind::kCurves;
  const std::size_t points = has_points ? static_cast<std::size_t>(offsets.back()) : count;
  check(attributes.material_slots.size(), "material_slots", count);
  if (corners > 1) check(attributes.corner_normals.size() / corners, "corner_normals", count);
  for (const auto& map : attributes.uv_maps) check(map.size() / corners, "corner_uvs", points);
  for (const auto& tangents : attributes.corner_tangents) check(tangents.size() / corners, "corner_tangents", count);
  for (const auto& places : attributes.generated) check(places.size() / corners, "corner_generated", count);
  for (const auto& colors : attributes.corner_colors) check(colors.size() / corners, "corner_colors", points);
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
    slot = attributes->material_slots[caller_number(mesh, primitive)];
  }
  // A triangle may name a slot that its object lacks: as in Blender, the last slot is then used.
  return slot_materials[static_cast<std::size_t>(first + std::clamp(slot, 0, count - 1))];
}

}  // namespace perfect_bvh
