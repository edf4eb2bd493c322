// Images on surfaces and around the scene: bilinear lookup in the caller's pixels.
// In: an image and a place in it. Out: scene-linear colour and alpha.
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

// What lies outside 0..1: the image again, its border's colour, nothing, the image turned round.
enum class Extension : std::uint8_t { kRepeat, kExtend, kClip, kMirror };

struct TextureTiles;

// A view of an image whose first row is at v = 0, the lower border. Exactly one of the pointers is set.
struct Texture {
  const std::uint8_t* bytes = nullptr;  // four a pixel: sRGB, alpha as it is
  const float* floats = nullptr;        // four a pixel: scene-linear
  int width = 0, height = 0;
  Extension extension = Extension::kRepeat;
  bool is_closest = false;                    // one pixel everywhere, not between four
  bool is_linear = false;                     // bytes are scene-linear, 0 to 1
  std::shared_ptr<const TextureTiles> tiles;  // if there are any, surfaces show those
};

// A UDIM image: one image for each unit square of a uv map, ten squares a row.
struct TextureTiles {
  static constexpr int kColumns = 10;
  std::vector<Texture> images;
  std::vector<std::int32_t> rows;  // of the images, square by square; -1 where there is none
};

// Alpha is straight: it does not darken the colour. Without colour and alpha where a clipped image ends.
[[nodiscard]] Rgba look_up(const Texture& texture, float u, float v) noexcept;

// The same, of a surface's place. Magenta where a tile is missing, as in Cycles.
[[nodiscard]] Rgba look_up_tiled(const Texture& texture, float u, float v) noexcept;

// The pixels of a row of the image. Lies in `buffer` where they are not kept as such colours.
[[nodiscard]] std::span<const Rgba> row_of_pixels(const Texture& texture, int y, std::vector<Rgba>& buffer);

// Where an equirectangular image that Blender lays round a scene has a direction: (u, v), 0 to 1.
[[nodiscard]] Point2 place_around(Vec3f direction) noexcept;

// The colour that comes from there.
[[nodiscard]] Vec3f look_up_around(const Texture& texture, Vec3f direction) noexcept;

// Appearance ----------------------------------------------------------------------------------------------------------
// What surfaces look like, as views of the caller's arrays: the renderer's only knowledge of colour.
// In: arrays that must outlive the render. Out: a material, a normal or a flag for a hit. Everything is optional: what
// is missing is grey, flat and visible.

class BrightSky;

inline constexpr std::int32_t kNoMaterial = -1;

// One row a triangle; empty if the mesh lacks the attribute. Of curves and points a row each; their layers may have one
// a control point instead, which `curve_offsets` tells apart: the first of each curve, then how many there are.
struct MeshAttributes {
  std::span<const std::int32_t> material_slots;
  std::span<const Vec3f> corner_normals;  // three a triangle, object space
  // By the numbers that textures and materials have for a mesh's layers: what lies beyond the end is lacking, too.
  std::vector<std::span<const Point2>> uv_maps;        // three a triangle; the first is the one that renders use
  std::vector<std::span<const Vec3f>> corner_colors;   // three a triangle, scene-linear
  std::vector<std::span<const Rgba>> corner_tangents;  // three a triangle, object space, and the bitangent's sign
  std::vector<std::span<const Vec3f>> generated;       // three a triangle, of one layer at most
  std::span<const std::int64_t> curve_offsets;
  // From a place in object space to one in the mesh's texture space, 0 to 1, which nodes call Generated; without a
  // layer of it.
  Vec3f generated_scale{0, 0, 0}, generated_offset{0, 0, 0};
};

inline constexpr std::int32_t kNoImage = -1;
inline constexpr std::int32_t kNoProgram = -1;

// What lights a scene from all around.
struct World {
  Vec3f color{0, 0, 0};           // or what the image's colours are multiplied with
  std::int32_t image = kNoImage;  // equirectangular
  float rotation = 0.0f;          // of the image about z, in radians
};

inline constexpr std::int32_t kNoHair = -1;

// What strands of hair are made of: a share of a fiber that light passes into, and one of an ordinary surface.
struct Hair {
  float surface = 0.0f, fiber = 0.0f;
  Vec3f absorption{0, 0, 0};  // by the fiber's radius
  bool colored = false;       // whether the material's base colour, as programs make it, absorbs light, too
  float roughness = 0.3f, radial_roughness = 0.3f;  // along the strand and around it, 0 to 1, as in Blender
  float coat = 0.0f;                                // how much of the roughness the first reflection is without
  float tilt = 0.0f;                                // of the cuticle's scales, in radians
  float ior = 1.55f;
};

// The camera and the size of its image, which nodes may ask for.
struct View {
  RayMaker rays;
  double width, height;
};

inline constexpr std::int32_t kNoFinish = -1;

// What few surfaces have: layers on top, brushed or rough structure. A row of numbers of the Python table.
struct Finish {
  Vec3f sheen{0, 0, 0};            // colour of a layer of fibers on top
  float sheen_roughness = 0.5f;    // of its fibers, 0 to 1
  float sheen_cover = 1.0f;        // how much of the light that it reflects is kept from what lies below
  float coat = 0.0f;               // weight of a clear layer below the sheen
  float coat_roughness = 0.03f;    // 0 to 1
  float coat_ior = 1.5f;           // 1 or more
  Vec3f coat_tint{1, 1, 1};        // of what lies below, seen from straight above
  float stretch = 1.0f;            // widens the slopes of facets along the tangent, and narrows them across it
  float rotation = 0.0f;           // of the tangent about the normal, in turns
  float diffuse_roughness = 0.0f;  // 0 to 1
  float distribution = 0.0f;       // of facets' slopes: a FacetKind
  Vec3f absorption{0, 0, 0};       // of light inside a mesh of it, by length
};
static_assert(sizeof(Finish) == 18 * sizeof(float));

// The colour that a lobe has: a row's colour times the base colour, as programs make it, to the row's power.
struct TintTable {
  std::span<const Vec3f> colors;
  std::span<const float> powers;
};

struct Appearance {
  // Tables, in the layout of the Python records of the same names.
  std::span<const Rgba> material_colors;
  std::span<const std::int32_t> material_pass_indices;
  // What they look like in light: a row a material, or empty.
  std::span<const Vec3f> base_colors;  // empty: as material_colors
  std::span<const Vec3f> emissions;    // radiance
  std::span<const float> alphas;
  std::span<const float> metallics, roughnesses;  // empty: 0 and 1
  std::span<const float> lossy_facets;            // share of light between facets that is lost; empty: 0
  std::span<const float> reflectances;            // of what is not metal, seen from straight above; empty: 0
  // A surface is split into shares: metal, of the rest what is clear, of the rest what is translucent; what remains is
  // diffuse under a dielectric reflection.
  std::span<const float> transmissions;      // empty: 0
  std::span<const float> translucencies;     // empty: 0
  std::span<const float> iors;               // of what is clear; empty: 1.5
  std::span<const float> even_metals;        // how much of the metal mirrors alike at all angles; empty: 0
  std::span<const float> tinted_glasses;     // how much of what is clear tints what it mirrors, too; empty: 0
  std::span<const float> plain_refractions;  // how much of what is clear mirrors nothing; empty: 0
  std::span<const Vec3f> specular_tints;     // of reflectances; of metals the colour at 82 degrees; empty: white
  TintTable metal_tints;                     // empty: white and 1
  TintTable transmission_tints;              // empty: white and 0.5
  TintTable translucent_tints;               // of all light on the whole surface; empty: black and 0
  std::span<const float> material_holdouts;  // how much of it cuts a hole into the image; empty: 0
  std::span<const std::int32_t> hairs;       // rows of `hair_rows`: what strands are of, or kNoHair
  std::span<const std::int32_t> finishes;    // rows of `finish_rows`, or kNoFinish
  std::span<const std::int32_t> instance_ids;
  std::span<const std::int32_t> slot_offsets;  // one more than instances
  std::span<const std::int32_t> slot_materials;
  std::span<const std::int32_t> object_pass_indices;
  std::span<const std::uint8_t> holdout;

  // Instead of what tables say: programs, and which of them a material has, or kNoProgram.
  std::vector<std::shared_ptr<const NodeProgram>> programs;
  std::span<const std::int32_t> material_programs;
  std::span<const Rgba> instance_values;  // of each instance as many as nodes ask for, one instance after the other

  std::vector<Hair> hair_rows;
  std::span<const Finish> finish_rows;
  std::vector<Texture> images;
  std::vector<Light> lights;
  std::optional<World> world;                   // none: the studio's sky and ground
  std::shared_ptr<const BrightSky> bright_sky;  // of the world's image, if it was worked out before
  std::optional<World> backdrop;                // what the camera sees instead of the world, and nothing is lit by
  std::optional<View> view;                     // none: nobody looks

  std::uint32_t camera_mask = 0xFFFFFFFFu;
  std::uint32_t shadow_mask = 0xFFFFFFFFu;
  std::uint32_t diffuse_mask = 0xFFFFFFFFu;  // of diffuse rays
  std::uint32_t glossy_mask = 0xFFFFFFFFu;   // of mirrored rays
  std::uint32_t transmission_mask = 0xFFFFFFFFu;
  std::uint32_t catcher_mask = 0;    // of what shows the shadows alone that others throw on it
  float frame_time = kShutterOpens;  // when, within the shutter, shapes are those that corner normals were taken of
  bool film_transparent = false;
  float plain_reflectance = 0.0f;     // of what has no material
  float pass_alpha_threshold = 0.0f;  // passes look through what has less alpha

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
  // Whether a camera ray that meets it finds a hole, and nothing else.
  [[nodiscard]] bool is_holdout(const Instance& instance, std::uint32_t primitive) const {
    if (!any_holdout_) return false;
    const auto row = row_of(instance);
    if (row >= 0 && holdout[static_cast<std::size_t>(row)] != 0) return true;
    return !material_holdouts.empty() && is_hole(material_of(instance, primitive));
  }
  [[nodiscard]] bool is_catcher(const Instance& instance) const noexcept { return (instance.mask & catcher_mask) != 0; }
  // Null for a material that tables alone describe.
  [[nodiscard]] const NodeProgram* program_of(std::int32_t material) const noexcept {
    if (material_programs.empty() || material == kNoMaterial) return nullptr;
    const std::int32_t row = material_programs[static_cast<std::size_t>(material)];
    return row == kNoProgram ? nullptr : programs[static_cast<std::size_t>(row)].get();
  }
  // What nodes ask of an instance; zero of those that are not listed.
  [[nodiscard]] Rgba value_of(const Instance& instance, std::size_t number) const noexcept;
  // Whether some material lets anything through.
  [[nodiscard]] bool any_transparent() const noexcept { return any_transparent_; }
  // Whether some material absorbs light inside its meshes; how much of it one of these rows does.
  [[nodiscard]] bool any_absorbing() const noexcept { return any_absorbing_; }
  [[nodiscard]] Vec3f absorption_of(std::int32_t material) const noexcept {
    if (finishes.empty() || material == kNoMaterial) return {0, 0, 0};
    const std::int32_t row = finishes[static_cast<std::size_t>(material)];
    return row == kNoFinish ? Vec3f{0, 0, 0} : finish_rows[static_cast<std::size_t>(row)].absorption;
  }
  // Whether nodes of some material bend its normals.
  [[nodiscard]] bool bends_normals() const noexcept { return bends_normals_; }
  // The row in the material table.
  [[nodiscard]] std::int32_t material_of(const Instance& instance, std::uint32_t primitive) const;

  // Throws InvalidArgument if the attributes of the instance's mesh do not have a row a triangle, curve or point.
  void check_fits(const Instance& instance, const MeshAttributes& attributes) const;

 private:
  [[nodiscard]] static std::int32_t row_in(const std::vector<std::int32_t>& rows, std::int32_t id) noexcept {
    const auto index = static_cast<std::size_t>(id);  // a negative id is beyond every table
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
