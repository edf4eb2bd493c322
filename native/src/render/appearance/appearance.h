// Images on surfaces and around the scene: bilinear lookup in the caller's pixels.
// In: an image and a position in it. Out: scene-linear colour and alpha.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "math/vec3.h"
#include "render/appearance/light.h"
#include "render/appearance/node_program.h"
#include "render/sampling/camera.h"
#include "tlas/assemble.h"
#include "traverse/ray.h"

namespace perfect_bvh {

// A colour with alpha: a row of the caller's arrays.
struct Rgba {
  float r = 0.0f, g = 0.0f, b = 0.0f, a = 0.0f;
};
static_assert(sizeof(Rgba) == 16);

// The values outside 0..1: the image repeated, its border's colour, nothing, the image mirrored. A sky repeats, and its
// rows are closer to each other at the horizon: their distance from it is the square root of the latitude.
enum class Extension : std::uint8_t { kRepeat, kExtend, kClip, kMirror, kSky };

struct TextureTiles;

// A view of an image whose first row is at v = 0, the lower border. Exactly one of the pointers is set.
struct Texture {
  const std::uint8_t* bytes = nullptr;  // four per pixel: sRGB, alpha linear
  const float* floats = nullptr;        // four per pixel: scene-linear
  int width = 0, height = 0;
  Extension extension = Extension::kRepeat;
  bool is_closest = false;                    // the nearest pixel, without interpolation
  bool is_linear = false;                     // bytes are scene-linear, 0 to 1
  std::shared_ptr<const TextureTiles> tiles;  // if set, surfaces show these
};

// A UDIM image: one image for each unit square of a uv map, ten squares per row.
struct TextureTiles {
  static constexpr int kColumns = 10;
  std::vector<Texture> images;
  std::vector<std::int32_t> rows;  // of the images, square by square; -1 if there is none
};

// Looks up a colour. Alpha is straight: it does not darken the colour. Returns zeros outside a clipped image.
[[nodiscard]] Rgba look_up(const Texture& texture, float u, float v) noexcept;

// The same for a point on a surface. Magenta if a tile is missing, as in Cycles.
[[nodiscard]] Rgba look_up_tiled(const Texture& texture, float u, float v) noexcept;

// Returns the pixels of a row of the image. They are written to `buffer` unless the image stores such colours.
[[nodiscard]] std::span<const Rgba> row_of_pixels(const Texture& texture, int y, std::vector<Rgba>& buffer);

// Returns the position of a direction, (u, v) from 0 to 1, in an equirectangular image that Blender maps around a
// scene, or in a sky.
[[nodiscard]] Point2 place_around(Vec3f direction, bool is_sky = false) noexcept;

// Returns the colour from that direction.
[[nodiscard]] Vec3f look_up_around(const Texture& texture, Vec3f direction) noexcept;

// Appearance ----------------------------------------------------------------------------------------------------------
// The appearance of surfaces, as views of the caller's arrays. The renderer has no other data on colour.
// In: arrays that must outlive the render. Out: a material, a normal or a flag for a hit. Everything is optional:
// without data, surfaces are grey, flat and visible.

class BrightSky;

inline constexpr std::int32_t kNoMaterial = -1;

// One row per triangle; empty if the mesh lacks the attribute. Curves and points have one row each. Their layers may
// have one row per control point instead, assigned by `curve_offsets`: the first of each curve, then their number.
struct MeshAttributes {
  std::span<const std::int32_t> material_slots;
  std::span<const Vec3f> corner_normals;  // three per triangle, object space
  // By the numbers that textures and materials use for a mesh's layers. Layers beyond the end do not exist either.
  std::vector<std::span<const Point2>> uv_maps;        // three per triangle; renders use the first by default
  std::vector<std::span<const Vec3f>> corner_colors;   // three per triangle, scene-linear
  std::vector<std::span<const Rgba>> corner_tangents;  // three per triangle, object space, and the bitangent's sign
  std::vector<std::span<const Vec3f>> generated;       // three per triangle, of at most one layer
  std::span<const std::int64_t> curve_offsets;
  // Maps a position in object space to the mesh's texture space, 0 to 1, which nodes call Generated. Used without a
  // layer of it.
  Vec3f generated_scale{0, 0, 0}, generated_offset{0, 0, 0};
};

inline constexpr std::int32_t kNoImage = -1;
inline constexpr std::int32_t kNoProgram = -1;

// The light from all around a scene.
struct World {
  Vec3f color{0, 0, 0};           // or the factor of the image's colours
  std::int32_t image = kNoImage;  // equirectangular
  float rotation = 0.0f;          // of the image about z, in radians
};

inline constexpr std::int32_t kNoHair = -1;

// The composition of hair strands: the share of a fiber that light enters, and the share of an ordinary surface.
struct Hair {
  float surface = 0.0f, fiber = 0.0f;
  Vec3f absorption{0, 0, 0};  // per fiber radius
  bool colored = false;       // whether the material's base colour, from its program, absorbs light too
  float roughness = 0.3f, radial_roughness = 0.3f;  // along the strand and around it, 0 to 1, as in Blender
  float coat = 0.0f;                                // the share of the roughness that the first reflection lacks
  float tilt = 0.0f;                                // of the cuticle's scales, in radians
  float ior = 1.55f;
};

// The camera and the size of its image, for nodes that use them.
struct View {
  RayMaker rays;
  double width, height;
};

inline constexpr std::int32_t kNoFinish = -1;

// Properties of few surfaces: top layers, brushed or rough structure. A row of numbers of the Python table.
struct Finish {
  Vec3f sheen{0, 0, 0};            // colour of a top layer of fibers
  float sheen_roughness = 0.5f;    // of its fibers, 0 to 1
  float sheen_cover = 1.0f;        // the share of its reflected light that is withheld from the layers below
  float coat = 0.0f;               // weight of a clear layer below the sheen
  float coat_roughness = 0.03f;    // 0 to 1
  float coat_ior = 1.5f;           // 1 or more
  Vec3f coat_tint{1, 1, 1};        // of the layers below, seen along the normal
  float stretch = 1.0f;            // widens the slopes of facets along the tangent, and narrows them across it
  float rotation = 0.0f;           // of the tangent about the normal, in turns
  float diffuse_roughness = 0.0f;  // 0 to 1
  float distribution = 0.0f;       // of facets' slopes: a FacetKind
  Vec3f absorption{0, 0, 0};       // of light inside a mesh of this material, per length
};
static_assert(sizeof(Finish) == 18 * sizeof(float));

// The colour of a lobe: a row's colour times the base colour, from the program, to the row's power.
struct TintTable {
  std::span<const Vec3f> colors;
  std::span<const float> powers;
};

struct Appearance {
  // Tables, in the layout of the Python records of the same names.
  std::span<const Rgba> material_colors;
  std::span<const std::int32_t> material_pass_indices;
  // Their properties for lighting: one row per material, or empty.
  std::span<const Vec3f> base_colors;  // empty: as material_colors
  std::span<const Vec3f> emissions;    // radiance
  std::span<const float> alphas;
  std::span<const float> metallics, roughnesses;  // defaults if empty: 0 and 1
  std::span<const float> lossy_facets;            // share of light lost between facets; empty: 0
  std::span<const float> reflectances;            // of the non-metal part, seen along the normal; empty: 0
  // A surface is divided into shares: metal; of the rest, clear; of the rest, translucent. The remainder is diffuse
  // under a dielectric reflection.
  std::span<const float> transmissions;      // empty: 0
  std::span<const float> translucencies;     // empty: 0
  std::span<const float> iors;               // of the clear share; empty: 1.5
  std::span<const float> even_metals;        // share of the metal that reflects equally at all angles; empty: 0
  std::span<const float> tinted_glasses;     // share of the clear part that also tints its reflection; empty: 0
  std::span<const float> plain_refractions;  // share of the clear part that reflects nothing; empty: 0
  std::span<const Vec3f> specular_tints;     // of reflectances; for metals, the colour at 82 degrees; empty: white
  TintTable metal_tints;                     // empty: white and 1
  TintTable transmission_tints;              // empty: white and 0.5
  TintTable translucent_tints;               // of all light on the whole surface; empty: black and 0
  std::span<const float> material_holdouts;  // the share that cuts a hole into the image; empty: 0
  std::span<const std::int32_t> hairs;       // rows of `hair_rows`, or kNoHair
  std::span<const std::int32_t> finishes;    // rows of `finish_rows`, or kNoFinish
  std::span<const std::int32_t> instance_ids;
  std::span<const std::int32_t> slot_offsets;  // one more than instances
  std::span<const std::int32_t> slot_materials;
  std::span<const std::int32_t> object_pass_indices;
  std::span<const std::uint8_t> holdout;

  // Programs that replace table values, and the program of each material, or kNoProgram.
  std::vector<std::shared_ptr<const NodeProgram>> programs;
  std::span<const std::int32_t> material_programs;
  std::span<const Rgba> instance_values;  // per instance, as many as nodes use, one instance after another

  std::vector<Hair> hair_rows;
  std::span<const Finish> finish_rows;
  std::vector<Texture> images;
  std::vector<Light> lights;
  std::optional<World> world;                   // none: the studio's sky and ground
  std::shared_ptr<const BrightSky> bright_sky;  // of the world's image, if it was computed before
  std::optional<World> backdrop;                // replaces the world for the camera only, without lighting anything
  std::optional<View> view;                     // empty: there is no camera

  std::uint32_t camera_mask = 0xFFFFFFFFu;
  std::uint32_t shadow_mask = 0xFFFFFFFFu;
  std::uint32_t diffuse_mask = 0xFFFFFFFFu;  // of diffuse rays
  std::uint32_t glossy_mask = 0xFFFFFFFFu;   // of mirrored rays
  std::uint32_t transmission_mask = 0xFFFFFFFFu;
  std::uint32_t catcher_mask = 0;    // of shadow catchers, which only show the shadows of others
  float frame_time = kShutterOpens;  // the time within the shutter to which corner normals belong
  bool film_transparent = false;
  float plain_reflectance = 0.0f;     // of surfaces without a material
  float pass_alpha_threshold = 0.0f;  // passes look through surfaces with less alpha

  void set_mesh(std::int32_t mesh_id, const MeshAttributes& attributes);
  // Call after the tables are set. Throws InvalidArgument for tables that do not match each other.
  void finish();

  // These accept any hit or instance; unlisted ones get kNoMaterial, 0 and false.
  [[nodiscard]] const MeshAttributes* attributes_of(const Instance& instance) const noexcept {
    const auto row = row_in(mesh_rows_, instance.mesh_id);
    return row < 0 ? nullptr : &meshes_[static_cast<std::size_t>(row)];
  }
  [[nodiscard]] std::int32_t row_of(const Instance& instance) const noexcept {
    return row_in(instance_rows_, instance.id);
  }
  // Returns whether a camera ray that hits it only finds a hole.
  [[nodiscard]] bool is_holdout(const Instance& instance, std::uint32_t primitive) const {
    if (!any_holdout_) return false;
    const auto row = row_of(instance);
    if (row >= 0 && holdout[static_cast<std::size_t>(row)] != 0) return true;
    return !material_holdouts.empty() && is_hole(material_of(instance, primitive));
  }
  [[nodiscard]] bool is_catcher(const Instance& instance) const noexcept { return (instance.mask & catcher_mask) != 0; }
  // Returns null for a material that only tables describe.
  [[nodiscard]] const NodeProgram* program_of(std::int32_t material) const noexcept {
    if (material_programs.empty() || material == kNoMaterial) return nullptr;
    const std::int32_t row = material_programs[static_cast<std::size_t>(material)];
    return row == kNoProgram ? nullptr : programs[static_cast<std::size_t>(row)].get();
  }
  // Returns a value that nodes read from an instance; zero if it is not listed.
  [[nodiscard]] Rgba value_of(const Instance& instance, std::size_t number) const noexcept;
  // Returns whether some material is partly transparent.
  [[nodiscard]] bool any_transparent() const noexcept { return any_transparent_; }
  // Returns whether some material absorbs light inside its meshes. The next function returns its absorption.
  [[nodiscard]] bool any_absorbing() const noexcept { return any_absorbing_; }
  [[nodiscard]] Vec3f absorption_of(std::int32_t material) const noexcept {
    if (finishes.empty() || material == kNoMaterial) return {0, 0, 0};
    const std::int32_t row = finishes[static_cast<std::size_t>(material)];
    return row == kNoFinish ? Vec3f{0, 0, 0} : finish_rows[static_cast<std::size_t>(row)].absorption;
  }
  // Returns whether nodes of some material bend its normals.
  [[nodiscard]] bool bends_normals() const noexcept { return bends_normals_; }
  // Returns the row in the material table.
  [[nodiscard]] std::int32_t material_of(const Instance& instance, std::uint32_t primitive) const;

  // Throws InvalidArgument if the attributes of the instance's mesh do not have one row per triangle, curve or point.
  void check_fits(const Instance& instance, const MeshAttributes& attributes) const;

 private:
  [[nodiscard]] static std::int32_t row_in(const std::vector<std::int32_t>& rows, std::int32_t id) noexcept {
    const auto index = static_cast<std::size_t>(id);  // a negative id is outside every table
    return index < rows.size() ? rows[index] : -1;
  }
  [[nodiscard]] bool is_hole(std::int32_t material) const noexcept;
  void check_tables() const;
  void check_materials() const;

  std::vector<MeshAttributes> meshes_;
  std::vector<std::int32_t> mesh_rows_;      // by mesh id: ids are small and never reused
  std::vector<std::int32_t> instance_rows_;  // by instance id
  bool any_holdout_ = false, any_transparent_ = false, bends_normals_ = false, any_absorbing_ = false;
};

}  // namespace perfect_bvh
