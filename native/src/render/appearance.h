// What surfaces look like, as views of the caller's arrays: the renderer's only knowledge of colour.
// In: arrays that must outlive the render. Out: a material, a normal or a flag for a hit. Everything is optional: what
// is missing is grey, flat and visible.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "scene/snapshot.h"
#include "traverse/ray.h"

namespace perfect_bvh {

inline constexpr std::int32_t kNoMaterial = -1;

// One row a triangle; empty if the mesh lacks the attribute.
struct MeshAttributes {
  std::span<const std::int32_t> material_slots;
  std::span<const Vec3f> corner_normals;  // three a triangle, object space
};

struct Rgba {
  float r = 0.0f, g = 0.0f, b = 0.0f, a = 0.0f;
};
static_assert(sizeof(Rgba) == 16);

struct Appearance {
  // Tables, in the layout of the Python records of the same names.
  std::span<const Rgba> material_colors;
  std::span<const std::int32_t> material_pass_indices;
  std::span<const std::int32_t> instance_ids;
  std::span<const std::int32_t> slot_offsets;  // one more than instances
  std::span<const std::int32_t> slot_materials;
  std::span<const std::int32_t> object_pass_indices;
  std::span<const std::uint8_t> holdout;

  std::uint32_t camera_mask = 0xFFFFFFFFu;
  std::uint32_t shadow_mask = 0xFFFFFFFFu;
  bool film_transparent = false;

  void set_mesh(std::int32_t mesh_id, const MeshAttributes& attributes);
  // Call after the tables are set. Throws InvalidArgument for tables that do not fit one another.
  void finish();

  // All of these take any hit or instance; what is not listed gets kNoMaterial, 0 and false.
  [[nodiscard]] const MeshAttributes* attributes_of(const Instance& instance) const noexcept {
    const auto row = row_in(mesh_rows_, instance.mesh_id);
    return row < 0 ? nullptr : &meshes_[static_cast<std::size_t>(row)];
  }
  [[nodiscard]] std::int32_t row_of(const Instance& instance) const noexcept {
    return row_in(instance_rows_, instance.id);
  }
  [[nodiscard]] bool is_holdout(const Instance& instance) const noexcept {
    if (!any_holdout_) return false;
    const auto row = row_of(instance);
    return row >= 0 && holdout[static_cast<std::size_t>(row)] != 0;
  }
  // The row in the material table.
  [[nodiscard]] std::int32_t material_of(const Instance& instance, std::uint32_t primitive) const;

  // Throws InvalidArgument if the attributes of the instance's mesh do not have a row a triangle.
  void check_fits(const Instance& instance, const MeshAttributes& attributes) const;

 private:
  [[nodiscard]] static std::int32_t row_in(const std::vector<std::int32_t>& rows, std::int32_t id) noexcept {
    const auto index = static_cast<std::size_t>(id);  // a negative id is beyond every table
    return index < rows.size() ? rows[index] : -1;
  }
  void check_tables() const;

  std::vector<MeshAttributes> meshes_;
  std::vector<std::int32_t> mesh_rows_;      // by mesh id: ids are small and never reused
  std::vector<std::int32_t> instance_rows_;  // by instance id
  bool any_holdout_ = false;
};

}  // namespace perfect_bvh
