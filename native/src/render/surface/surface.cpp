#include "render/surface/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "math/elementary.h"
#include "query/round_surface.h"

namespace perfect_bvh {
namespace {

constexpr float kPlainRoughness = 0.5f;

// What one of a mesh's layers, uvs or colours, has where a ray hit: between the corners of a triangle, and of curves
// and points either what a whole one has, or between the control points of a curve.
Vec3f mixed(Vec3f a, float share_a, Vec3f b, float share_b) noexcept { return a * share_a + b * share_b; }
Point2 mixed(Point2 a, float share_a, Point2 b, float share_b) noexcept {
  return {a.x * share_a + b.x * share_b, a.y * share_a + b.y * share_b};
}

// Of curves and points; the layer is known to fit.
template <class T>
T round_layer_at(const Mesh& mesh, const MeshAttributes& attributes, std::span<const T> layer,
                 const Hit& hit) noexcept {
  const std::size_t part = caller_number(mesh, hit.primitive_index);
  if (layer.size() == part_count_of(mesh)) return layer[part];
  const auto first = static_cast<std::size_t>(attributes.curve_offsets[part]);
  const std::size_t spans = static_cast<std::size_t>(attributes.curve_offsets[part + 1]) - first - 1;
  const float along = u_of_part(mesh, hit.primitive_index, hit.u) * static_cast<float>(spans);
  const std::size_t span = std::min(static_cast<std::size_t>(std::max(along, 0.0f)), spans - 1);
  const float u = along - static_cast<float>(span);
  return mixed(layer[first + span], 1.0f - u, layer[first + span + 1], u);
}

// None if the mesh lacks the layer of that number. Throws InvalidArgument for one that does not fit the mesh.
template <class T>
std::optional<T> layer_at(const Appearance& appearance, const Instance& instance, const Hit& hit,
                          std::vector<std::span<const T>> MeshAttributes::* layers, std::int32_t number) {
  const MeshAttributes* const attributes = appearance.attributes_of(instance);
  const auto index = static_cast<std::size_t>(number);
  if (attributes == nullptr || index >= (attributes->*layers).size()) return std::nullopt;
  const std::span<const T> layer = (attributes->*layers)[index];
  if (layer.empty()) return std::nullopt;
  appearance.check_fits(instance, *attributes);
  const Mesh& mesh = instance.blas->mesh;
  if (mesh.is_round()) return round_layer_at(mesh, *attributes, layer, hit);
  const auto corners = layer.subspan(std::size_t{3} * hit.primitive_index).template first<3>();
  return mixed(mixed(corners[0], 1.0f - hit.u - hit.v, corners[1], hit.u), 1.0f, corners[2], hit.v);
}

}  // namespace

std::optional<Point2> uv_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t map) {
  return layer_at(appearance, instance, hit, &MeshAttributes::uv_maps, map);
}

namespace {

// Black where the mesh has no such colours, as in Blender.
Vec3f tint_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t tint) {
  const Vec3f black{0.0f, 0.0f, 0.0f};
  return layer_at(appearance, instance, hit, &MeshAttributes::corner_colors, tint).value_or(black);
}

// What a table without rows stands for is in the last two arguments.
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

void look_up_images(const Appearance& appearance, const Instance& instance, const Hit& hit, std::size_t index,
                    Material& material) {
  const auto image_in = [&](std::span<const std::int32_t> images) { return images.empty() ? kNoImage : images[index]; };
  const std::int32_t color_image = image_in(appearance.color_images), alpha_image = image_in(appearance.alpha_images);
  const std::int32_t emission_image = image_in(appearance.emission_images);
  if (color_image == kNoImage && alpha_image == kNoImage && emission_image == kNoImage) return;
  std::int32_t map = -1;
  Point2 uv{0.0f, 0.0f};
  const auto look = [&](std::int32_t image) {
    const Texture& texture = appearance.images[static_cast<std::size_t>(image)];
    if (texture.uv_map != map) {  // mostly all have the same one
      map = texture.uv_map;
      // Without the map everything shows the image's corner, as in Blender.
      uv = uv_at(appearance, instance, hit, map).value_or(Point2{0.0f, 0.0f});
    }
    return look_up_mapped(texture, uv.x, uv.y);
  };
  Rgba color;
  if (color_image != kNoImage) {
    color = look(color_image);
    material.color = {color.r, color.g, color.b};
    if (!appearance.color_scales.empty()) material.color = material.color * appearance.color_scales[index];
  }
  if (alpha_image != kNoImage) {
    if (alpha_image != color_image) color = look(alpha_image);
    material.alpha *= std::clamp(color.a, 0.0f, 1.0f);
  }
  if (emission_image != kNoImage) {
    color = look(emission_image);
    material.emission = material.emission * Vec3f{color.r, color.g, color.b};
  }
}

}  // namespace

Material material_at(const Appearance& appearance, const Instance& instance, const Hit& hit, std::int32_t row) {
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
  look_up_images(appearance, instance, hit, index, material);
  if (const std::int32_t tint = appearance.tints.empty() ? kNoTint : appearance.tints[index]; tint != kNoTint) {
    material.color = material.color * tint_at(appearance, instance, hit, tint);
  }
  set_scattering(appearance, index, material);
  if (!appearance.hairs.empty() && appearance.hairs[index] != kNoHair) {
    material.hair = &appearance.hair_rows[static_cast<std::size_t>(appearance.hairs[index])];
  }
  return material;
}

// Surface -------------------------------------------------------------------------------------------------------------

namespace {

// A corner normal that points this far to the other side of its triangle is not a curved surface's: the triangle is
// wound the other way than its neighbours.
constexpr double kTurnedCosine = -0.3;

// The hit triangle in its mesh's frame.
struct ObjectTriangle {
  std::array<Vec3d, 3> corners;
  std::array<double, 3> weights;  // of the corners, at the hit

  [[nodiscard]] Vec3d point() const noexcept {
    return corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
  }
};

ObjectTriangle object_triangle(const Instance& instance, const Hit& hit, float time) noexcept {
  const Mesh& mesh = instance.blas->mesh;
  const TriangleIndices corners = mesh.triangles[hit.primitive_index];
  const Moment moment = moment_of(instance, time);
  const double u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
  return {{to_double(mesh.position_at(corners.x, moment)), to_double(mesh.position_at(corners.y, moment)),
           to_double(mesh.position_at(corners.z, moment))},
          {1.0 - u - v, u, v}};
}

// Unit length, on the outer side as the mesh's own winding has it; zero for a triangle without area.
Vec3d outer_normal(const Instance& instance, const ObjectTriangle& triangle) noexcept {
  const Affine& map = instance.object_to_world;
  const Vec3d edge1 = map.vector(triangle.corners[1] - triangle.corners[0]);
  const Vec3d edge2 = map.vector(triangle.corners[2] - triangle.corners[0]);
  const Vec3d normal = normalized(cross(edge1, edge2));
  return instance.mirrored ? -normal : normal;
}

using CornerNormals = std::array<Vec3f, 3>;

// Normals of a triangle at one time, at another: they turn and are sheared as it is.
CornerNormals carried(const CornerNormals& normals, const ObjectTriangle& from, const ObjectTriangle& to) noexcept {
  const auto edge = [](const ObjectTriangle& triangle, int i) { return triangle.corners[i] - triangle.corners[0]; };
  const Vec3d a1 = edge(from, 1), a2 = edge(from, 2), b1 = edge(to, 1), b2 = edge(to, 2);
  const Vec3d a = normalized(cross(a1, a2)), b = normalized(cross(b1, b2));
  CornerNormals result = normals;
  for (Vec3f& corner : result) {
    const Vec3d normal = to_double(corner);
    const Vec3d turned =
        cross(b2, b) * dot(a1, normal) + cross(b, b1) * dot(a2, normal) + cross(b1, b2) * dot(a, normal);
    const double size = length(turned);
    if (size > 0.0 && std::isfinite(size)) corner = to_float(turned * (1.0 / size));
  }
  return result;
}

// Of the triangle as it is when it is hit.
CornerNormals corner_normals(const Appearance& appearance, const MeshAttributes& attributes, const Instance& instance,
                             const Hit& hit, const ObjectTriangle& triangle) {
  appearance.check_fits(instance, attributes);
  const auto given = attributes.corner_normals.subspan(std::size_t{3} * hit.primitive_index).first<3>();
  const CornerNormals normals{given[0], given[1], given[2]};
  if (!instance.blas->mesh.moves()) return normals;
  return carried(normals, object_triangle(instance, hit, appearance.frame_time), triangle);
}

// Unit length; `fallback` where the corners' normals cancel out.
Vec3d smooth_normal(const Instance& instance, const CornerNormals& normals, const ObjectTriangle& triangle,
                    Vec3d fallback) noexcept {
  const Vec3d object = to_double(normals[0]) * triangle.weights[0] + to_double(normals[1]) * triangle.weights[1] +
                       to_double(normals[2]) * triangle.weights[2];
  // By the cofactors, which are the inverse's transpose but for a factor.
  const Affine& map = instance.object_to_world;
  const Vec3d world =
      (cross(map.y, map.z) * object.x + cross(map.z, map.x) * object.y + cross(map.x, map.y) * object.z) *
      (instance.mirrored ? -1.0 : 1.0);
  const double size = length(world);
  return size > 0.0 && std::isfinite(size) ? world * (1.0 / size) : fallback;
}

// The way from the hit point to the curved surface that the corner normals suggest, where that bulges outwards: rays
// that leave a coarse mesh from its flat triangles would hit its neighbours (Hanika, "Hacking the Shadow Terminator",
// 2021). `side` is -1 when the viewer sees the inner side.
Vec3d lift_of(const CornerNormals& normals, const ObjectTriangle& triangle, double side) noexcept {
  const Vec3d point = triangle.point();
  Vec3d lift{0, 0, 0};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d normal = normalized(to_double(normals[i])) * side;
    const double below = std::min(0.0, dot(point - triangle.corners[i], normal));
    lift = lift - normal * (below * triangle.weights[i]);
  }
  return lift;
}

// A bound of how far rounding may move a point of this triangle on its way to a kernel and back. In the mesh's frame
// kernels work in single precision: a coordinate is off by at most half a unit in its last place, 2^-24 of the
// largest one; a triangle test adds a few of the same size. The map to the world scales that.
double clearance(const Instance& instance, const ObjectTriangle& triangle) noexcept {
  constexpr double kUnits = 8.0 * 0x1p-24;
  const auto reach = [&](int axis) {
    return std::max({std::abs(triangle.corners[0][axis]), std::abs(triangle.corners[1][axis]),
                     std::abs(triangle.corners[2][axis])});
  };
  const auto sum = [](Vec3d v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
  const Affine& map = instance.object_to_world;
  // The world's own double-precision rounding matters only far from its origin.
  const double world = sum(map.translation) * 0x1p-50;
  return kUnits * (sum(map.x) * reach(0) + sum(map.y) * reach(1) + sum(map.z) * reach(2)) + world;
}

// Of curves and points, which kernels find in double precision.
void set_round_normals(const Instance& instance, const Ray& ray, const Hit& hit, bool with_origin,
                       SurfacePoint& point) {
  const RoundPoint round = RoundPlacer().place(instance, hit, ray);
  // A tip has no normal: the way back is as good as any.
  const bool degenerate = round.normal == Vec3d{0, 0, 0};
  const Vec3d facing = degenerate ? normalized(-ray.direction) : round.normal * (round.is_entry ? 1.0 : -1.0);
  point.geometric_normal = to_float(facing);
  point.inside = !round.is_entry;
  point.normal = point.light_normal = point.geometric_normal;
  point.along = to_float(normalized(round.along));
  if (!with_origin) return;
  const auto largest = [](Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); };
  const double clear = 0x1p-40 * (largest(round.position) + largest(instance.object_to_world.translation));
  const bool is_ribbon = instance.blas->mesh.shape == CurveShape::kRibbon;
  point.origin = round.before + facing * clear;
  point.beyond = round.behind + (is_ribbon ? normalized(ray.direction) : -facing) * clear;
}

void set_normals(const Appearance& appearance, const Instance& instance, const Ray& ray, const Hit& hit,
                 bool with_origin, SurfacePoint& point) {
  if (instance.blas->mesh.is_round()) return set_round_normals(instance, ray, hit, with_origin, point);
  const ObjectTriangle triangle = object_triangle(instance, hit, ray.time);
  const MeshAttributes* attributes = appearance.attributes_of(instance);
  // What a transform has flattened is a plane, whatever its corner normals were.
  const bool smooth = attributes != nullptr && !attributes->corner_normals.empty() && !instance.baked;
  const Vec3d outer = outer_normal(instance, triangle);
  // A triangle without area has no normal: the way back is as good as any.
  const bool degenerate = outer == Vec3d{0, 0, 0};
  const double side = dot(outer, ray.direction) > 0.0 ? -1.0 : 1.0;
  const Vec3d facing = degenerate ? normalized(-ray.direction) : outer * side;
  point.geometric_normal = to_float(facing);
  point.inside = side < 0.0;
  point.normal = point.light_normal = point.geometric_normal;
  const Vec3d on_triangle = triangle.point();
  if (smooth) {
    const CornerNormals normals = corner_normals(appearance, *attributes, instance, hit, triangle);
    const Vec3d normal = smooth_normal(instance, normals, triangle, facing * side) * side;
    const double light_side = dot(normal, facing) < kTurnedCosine ? -1.0 : 1.0;
    point.normal = to_float(normal);
    point.light_normal = to_float(normal * light_side);
    if (with_origin) {
      const Vec3d lift = lift_of(normals, triangle, side * light_side);
      point.lift = to_float(instance.object_to_world.vector(lift));
    }
  }
  if (with_origin) {
    const Vec3d clear = facing * clearance(instance, triangle);
    point.origin = instance.object_to_world.point(on_triangle) + clear;
    point.beyond = instance.object_to_world.point(on_triangle) - clear;
  }
}

}  // namespace

Vec3f material_color(const Appearance& appearance, std::int32_t material) noexcept {
  if (material == kNoMaterial) return kPlainColor;
  const Rgba& color = appearance.material_colors[static_cast<std::size_t>(material)];
  return {color.r, color.g, color.b};
}

void find_surfaces(const Snapshot& snapshot, const Appearance& appearance, SurfaceNeeds needs,
                   std::span<const Ray> rays, std::span<const Hit> hits, AlignedVector<SurfacePoint>& points) {
  for (std::size_t row = 0; row < hits.size(); ++row) {
    const Hit& hit = hits[row];
    if (!hit.found()) continue;
    const Instance& instance = snapshot.instances[hit.instance_index];
    if (!needs.holdouts && appearance.is_holdout(instance, hit.primitive_index)) continue;
    SurfacePoint point;
    const Ray& ray = rays[row];
    point.ray = static_cast<std::uint32_t>(row), point.time = ray.time;
    if (needs.normals) {
      const bool turns = instance.turns != nullptr;
      set_normals(appearance, turns ? posed(instance, ray.time) : instance, ray, hit, needs.origins, point);
    }
    if (needs.materials) {
      point.material = appearance.material_of(instance, hit.primitive_index);
      point.color = material_color(appearance, point.material);
    }
    points.push_back(point);
  }
}

}  // namespace perfect_bvh
