#include "render/surface/hit_inputs.h"

#include <algorithm>
#include <cmath>

#include "query/round_surface.h"

namespace perfect_bvh {
namespace {

// The distance from a hit at which a bump's heights are evaluated, relative to the distance to the viewer and to the
// coordinates. The first is used without a camera, whose pixels otherwise count; the second is a minimum.
constexpr double kAside = 1e-4, kLeastAside = 3e-5;

void put(NodeChannel* channels, std::size_t lane, Vec3f v) noexcept {
  channels[0][lane] = v.x, channels[1][lane] = v.y, channels[2][lane] = v.z;
}

}  // namespace

void HitInputs::add(const Instance& instance, const Ray& ray, const Hit& hit, const SurfacePoint& point) {
  Lane& lane = lanes_[count_++];
  lane.instance = &instance, lane.ray = &ray, lane.point = &point;
  lane.sides[0] = hit;
  if (instance.turns != nullptr) lane.instance = &posed_.emplace_back(posed(instance, ray.time));
}

void HitInputs::prepare(const NodeNeeds& needs) {
  if (!needs.points) return;
  for (std::size_t i = 0; i < count_; ++i) {
    Lane& lane = lanes_[i];
    const Affine& map = lane.instance->object_to_world;
    lane.ways[0] = lane.ways[1] = lane.ways[2] = {0, 0, 0};
    if (lane.instance->blas->mesh.is_round()) {
      const Vec3d on_ray = lane.ray->origin + lane.ray->direction * static_cast<double>(lane.sides[0].t);
      lane.places[0] = inverse(map).point(on_ray);
      lane.sides[1] = lane.sides[2] = lane.sides[0], lane.places[1] = lane.places[2] = lane.places[0];
      continue;
    }
    lane.places[0] = object_triangle(*lane.instance, lane.sides[0], lane.ray->time).point();
    if (needs.sides) find_sides(lane, needs.aside);
  }
}

// The two vectors span the triangle's plane in the world, oriented as in Cycles; their ends are the same steps in u and
// v.
void HitInputs::find_sides(Lane& lane, float pixels) const {
  const Affine& map = lane.instance->object_to_world;
  const ObjectTriangle triangle = object_triangle(*lane.instance, lane.sides[0], lane.ray->time);
  const Vec3d e1 = map.vector(triangle.corners[1] - triangle.corners[0]);
  const Vec3d e2 = map.vector(triangle.corners[2] - triangle.corners[0]);
  const Vec3d area = cross(e1, e2), normal = to_double(lane.point->geometric_normal);
  const bool is_even = normal.x == normal.y && normal.x == normal.z;  // along the first of the two diagonals
  const Vec3d x = normalized(cross(Vec3d{is_even ? -1.0 : 1.0, 1.0, 1.0}, normal)), y = cross(normal, x);
  const double aside = way_aside(lane, map.point(lane.places[0]), pixels), scale = 1.0 / dot(area, area);
  const Vec3d ways[2] = {x * aside, y * aside};
  for (int i = 0; i < 2; ++i) {
    Hit& beside = lane.sides[i + 1] = lane.sides[0];
    const double u = dot(cross(ways[i], e2), area) * scale, v = dot(cross(e1, ways[i]), area) * scale;
    const bool is_flat = !std::isfinite(u) || !std::isfinite(v);
    lane.ways[i + 1] = is_flat ? Vec3f{0, 0, 0} : to_float(ways[i]);
    if (!is_flat) beside.u += static_cast<float>(u), beside.v += static_cast<float>(v);
    lane.places[i + 1] = object_triangle(*lane.instance, beside, lane.ray->time).point();
  }
}

double HitInputs::way_aside(const Lane& lane, Vec3d position, float pixels) const noexcept {
  const double size = std::max({std::abs(position.x), std::abs(position.y), std::abs(position.z)});
  const double way = length(position - lane.ray->origin);
  if (!appearance_.view || !(pixels > 0.0f)) return kAside * (way + size);
  const double known = lane.point->pixel;
  const double pixel = known > 0.0 ? known : appearance_.view->rays.pixel_size(position - lane.ray->origin);
  return std::max(static_cast<double>(pixels) * pixel, kLeastAside * (way + size));
}

// Returns the position in the camera's image.
Vec3f HitInputs::in_image(Vec3d position) const {
  if (!appearance_.view) return {0, 0, 0};
  const ImagePoint at = appearance_.view->rays.place_of(position);
  const Vec3d place{at.x / appearance_.view->width, 1.0 - at.y / appearance_.view->height, 0.0};
  return is_finite(place) ? to_float(place) : Vec3f{0, 0, 0};
}

Affine HitInputs::to_world(const Lane& lane, VectorSpace space) const {
  if (space == VectorSpace::kCamera) return appearance_.view ? appearance_.view->rays.frame() : Affine{};
  if (space == VectorSpace::kWorld) return {};
  Affine map = lane.instance->object_to_world;  // from the mesh's stored frame
  map.translation = map.point(-lane.instance->blas->mesh.centre);
  return map;
}

Vec3f HitInputs::transformed(std::size_t lane, Vec3f v, VectorKind kind, VectorSpace from, VectorSpace to) const {
  const Affine there = to_world(lanes_[lane], from), back = to_world(lanes_[lane], to);
  const Vec3d given = to_double(v);
  Vec3d made =
      kind == VectorKind::kPoint ? inverse(back).point(there.point(given)) : inverse(back).vector(there.vector(given));
  if (kind == VectorKind::kNormal) made = normalized(back.transposed_vector(inverse(there).transposed_vector(given)));
  return is_finite(made) ? to_float(made) : Vec3f{0, 0, 0};
}

Vec3f HitInputs::object_normal_of(const Lane& lane) const {
  const Instance& instance = *lane.instance;
  const SurfacePoint& point = *lane.point;
  if (!instance.blas->mesh.is_round()) {
    const ObjectTriangle triangle = object_triangle(instance, lane.sides[0], lane.ray->time);
    const MeshAttributes* const attributes = appearance_.attributes_of(instance);
    if (attributes != nullptr && !attributes->corner_normals.empty() && !instance.baked) {
      return to_float(
          object_normal(corner_normals(appearance_, *attributes, instance, lane.sides[0], triangle), triangle));
    }
    return to_float(
        normalized(cross(triangle.corners[1] - triangle.corners[0], triangle.corners[2] - triangle.corners[0])));
  }
  const Vec3d outer = to_double(point.normal) * (point.inside ? -1.0 : 1.0);
  return to_float(normalized(instance.object_to_world.transposed_vector(outer)));
}

Rgba HitInputs::tangent_of(const Lane& lane, int uv_map) const {
  const MeshAttributes* const attributes = appearance_.attributes_of(*lane.instance);
  const auto row = static_cast<std::size_t>(uv_map);
  if (attributes == nullptr || row >= attributes->corner_tangents.size()) return {};
  const std::span<const Rgba> layer = attributes->corner_tangents[row];
  if (layer.empty() || lane.instance->blas->mesh.is_round()) return {};
  appearance_.check_fits(*lane.instance, *attributes);
  const auto corners = layer.subspan(std::size_t{3} * lane.sides[0].primitive_index).first<3>();
  const float u = lane.sides[0].u, v = lane.sides[0].v, rest = 1.0f - u - v;
  return {corners[0].r * rest + corners[1].r * u + corners[2].r * v,
          corners[0].g * rest + corners[1].g * u + corners[2].g * v,
          corners[0].b * rest + corners[1].b * u + corners[2].b * v, corners[0].a};
}

Vec3f HitInputs::vector_of(NodeInput input, const Lane& lane, int side) const {
  const SurfacePoint& point = *lane.point;
  const auto incoming = [&] { return to_float(-normalized(lane.ray->direction)); };
  const auto row = static_cast<std::size_t>(side);
  switch (input) {
    case NodeInput::kPosition:
      return to_float(lane.instance->object_to_world.point(lane.places[row]));
    case NodeInput::kNormal:
      return point.light_normal;
    case NodeInput::kTrueNormal:
      return point.geometric_normal;
    case NodeInput::kIncoming:
      return incoming();
    case NodeInput::kReflection: {
      const Vec3f view = incoming();
      return point.light_normal * (2.0f * dot(view, point.light_normal)) - view;
    }
    case NodeInput::kBackfacing:
      return point.inside ? Vec3f{1, 1, 1} : Vec3f{0, 0, 0};
    case NodeInput::kObject:
      return to_float(lane.places[row] + lane.instance->blas->mesh.centre);
    case NodeInput::kGenerated: {
      const MeshAttributes* const attributes = appearance_.attributes_of(*lane.instance);
      if (attributes == nullptr) return {0, 0, 0};
      return to_float(lane.places[row] + lane.instance->blas->mesh.centre) * attributes->generated_scale +
             attributes->generated_offset;
    }
    case NodeInput::kObjectNormal:
      return object_normal_of(lane);
    case NodeInput::kWindow:
      return in_image(lane.instance->object_to_world.point(lane.places[row]));
    default:
      return {0, 0, 0};
  }
}

void HitInputs::read(NodeInput input, int number, int side, NodeChannel* channels) {
  for (std::size_t i = 0; i < count_; ++i) {
    const Lane& lane = lanes_[i];
    const Hit& hit = lane.sides[side];
    switch (input) {
      case NodeInput::kUv: {
        const Point2 uv = uv_at(appearance_, *lane.instance, hit, number).value_or(Point2{0.0f, 0.0f});
        put(channels, i, {uv.x, uv.y, 0.0f});
        break;
      }
      case NodeInput::kColor:
        put(channels, i,
            layer_at(appearance_, *lane.instance, hit, &MeshAttributes::corner_colors, number)
                .value_or(Vec3f{0, 0, 0}));
        break;
      case NodeInput::kGenerated:
        put(channels, i,
            layer_at(appearance_, *lane.instance, hit, &MeshAttributes::generated, 0)
                .value_or(vector_of(input, lane, side)));
        break;
      case NodeInput::kTangent: {
        const Rgba tangent = tangent_of(lane, number);
        put(channels, i, {tangent.r, tangent.g, tangent.b});
        channels[3][i] = tangent.a;
        break;
      }
      case NodeInput::kInstance: {
        const Rgba value = appearance_.value_of(*lane.instance, static_cast<std::size_t>(number));
        put(channels, i, {value.r, value.g, value.b});
        channels[3][i] = value.a;
        break;
      }
      case NodeInput::kSide:
        put(channels, i, lane.ways[number]);
        break;
      default:
        put(channels, i, vector_of(input, lane, side));
    }
  }
}

}  // namespace perfect_bvh
