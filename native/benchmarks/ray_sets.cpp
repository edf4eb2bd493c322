#include "ray_sets.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <stdexcept>

#include "mesh/primitive_traits.h"

namespace perfect_bvh::bench {
namespace {

using Random = std::mt19937;

double uniform(Random& random) { return static_cast<double>(random()) * 0x1p-32; }

Vec3d cosine_direction(Vec3d normal, Random& random) {
  for (;;) {
    const Vec3d p{2 * uniform(random) - 1, 2 * uniform(random) - 1, 2 * uniform(random) - 1};
    const double square = dot(p, p);
    if (square > 1e-3 && square <= 1) return normalized(normalized(p) + normal * 1.0001);
  }
}

Ray make_ray(Vec3d origin, Vec3d direction, float t_max) {
  Ray ray;
  // Rounded to float, so that every peer gets exactly the same ray.
  ray.origin = to_double(to_float(origin)), ray.direction = to_double(to_float(direction)), ray.t_max = t_max;
  return ray;
}

}  // namespace

std::vector<Ray> primary_rays(const Aabb& box, View view, std::uint32_t width, std::uint32_t height) {
  const Vec3d centre = to_double(box.lower + box.upper) * 0.5, extent = to_double(box.extent());
  const double diagonal = length(extent), aspect = static_cast<double>(width) / height;
  Vec3d eye = centre + normalized(Vec3d{0.5, 0.25, 1.0}) * diagonal, target = centre;
  double half_height = view == View::kFilling ? 0.15 : 0.42;
  if (view == View::kInside) {
    eye = centre + Vec3d{0.25 * diagonal, -0.2 * extent.y, 0.0};
    target = centre - Vec3d{0.2 * diagonal, 0.0, 0.02 * diagonal};
    half_height = 0.7;
  }
  const Vec3d forward = normalized(target - eye), right = normalized(cross(forward, Vec3d{0, 1, 0}));
  const Vec3d up = cross(right, forward);
  Random random(3);
  std::vector<Ray> rays;
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const double across = ((x + uniform(random)) / width * 2 - 1) * half_height * aspect;
      const double upward = (1 - (y + uniform(random)) / height * 2) * half_height;
      rays.push_back(make_ray(eye, normalized(forward + right * across + up * upward), kInfiniteDistance));
    }
  }
  return rays;
}

Ray diffuse_ray(Vec3d origin, Vec3d normal, std::mt19937& random) {
  return make_ray(origin, cosine_direction(normal, random), kInfiniteDistance);
}

Bounces bounce_rays(const Mesh& mesh, const std::vector<Ray>& primary, const std::vector<Hit>& hits, float diagonal) {
  Bounces result;
  Random random(5);
  for (std::size_t i = 0; i < primary.size(); ++i) {
    if (!hits[i].found()) continue;
    const TriangleIndices corners = mesh.triangles[hits[i].primitive_index];
    const Vec3d v0 = to_double(mesh.positions[corners.x]);
    Vec3d normal =
        normalized(cross(to_double(mesh.positions[corners.y]) - v0, to_double(mesh.positions[corners.z]) - v0));
    if (dot(normal, normal) < 0.5) continue;
    if (dot(normal, primary[i].direction) > 0) normal = -normal;
    const Vec3d origin = primary[i].origin + primary[i].direction * hits[i].t + normal * (1e-4 * diagonal);
    result.diffuse.push_back(diffuse_ray(origin, normal, random));
    result.occlusion.push_back(make_ray(origin, cosine_direction(normal, random), 0.1f * diagonal));
  }
  return result;
}

namespace {

// Returns the pixels of an image in Z-order within tiles of 8 x 8, tiles row by row. Pixels beyond the last whole tile
// are left out.
std::vector<std::size_t> tiled_order(std::size_t width, std::size_t height) {
  std::vector<std::size_t> order;
  const auto every_other_bit = [](std::size_t bits) { return (bits & 1) | (bits >> 1 & 2) | (bits >> 2 & 4); };
  for (std::size_t y = 0; y + 8 <= height; y += 8) {
    for (std::size_t x = 0; x + 8 <= width; x += 8) {
      for (std::size_t i = 0; i < 64; ++i)
        order.push_back((y + every_other_bit(i >> 1)) * width + x + every_other_bit(i));
    }
  }
  return order;
}

}  // namespace

std::vector<RaySet> make_ray_sets(const Mesh& mesh, const Aabb& box, View, const std::vector<Ray>& primary,
                                  const std::vector<Hit>& hits) {
  Bounces bounces = bounce_rays(mesh, primary, hits, length(box.extent()));
  std::vector<Ray> shuffled = bounces.diffuse;
  std::shuffle(shuffled.begin(), shuffled.end(), Random(7));
  return {{"primary", {false, true}, primary},
          {"diffuse", {false, false}, std::move(bounces.diffuse)},
          {"shuffled", {false, false}, std::move(shuffled)},
          {"occlusion", {true, false}, std::move(bounces.occlusion)}};
}

std::vector<RaySet> make_coherent_sets(const Aabb& box, const std::vector<Ray>& primary, const std::vector<Hit>& hits,
                                       std::uint32_t width) {
  const auto diagonal = static_cast<double>(length(box.extent()));
  const Vec3d light = to_double(box.lower + box.upper) * 0.5 + Vec3d{0.1, 0.6, 0.2} * diagonal;
  std::vector<Ray> tiled, shadow;
  for (const std::size_t row : tiled_order(width, primary.size() / width)) {
    const Ray& ray = primary[row];
    tiled.push_back(ray);
    if (!hits[row].found()) continue;
    const Vec3d at = ray.origin + ray.direction * (static_cast<double>(hits[row].t) - 1e-4 * diagonal);
    shadow.push_back(make_ray(at, light - to_double(to_float(at)), 1.0f));
  }
  return {{"tiled", {false, true}, std::move(tiled)}, {"shadow", {true, true}, std::move(shadow)}};
}

std::vector<Ray> aimed_rays(const Mesh& mesh, std::size_t count, bool at_edges, std::size_t seed) {
  Random random(static_cast<std::uint32_t>(seed));
  std::vector<Ray> rays;
  rays.reserve(count);
  while (rays.size() < count) {
    const TriangleIndices corners = mesh.triangles[random() % mesh.primitive_count()];
    const Vec3d a = to_double(mesh.positions[corners.x]), b = to_double(mesh.positions[corners.y]);
    const Vec3d target = at_edges ? a + (b - a) * uniform(random) : a;
    const Vec3d towards = to_double(mesh.positions[random() % mesh.positions.size()]);
    const Vec3d origin = to_double(to_float(towards * (0.5 * uniform(random))));
    rays.push_back(make_ray(origin, to_double(to_float(target)) - origin, kInfiniteDistance));
  }
  return rays;
}

Mesh read_mesh(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint32_t counts[2] = {0, 0};
  file.read(reinterpret_cast<char*>(counts), sizeof(counts));
  Mesh mesh;
  if (file) {
    mesh.positions.resize(counts[0]);
    AlignedVector<TriangleIndices> triangles(counts[1]);
    file.read(reinterpret_cast<char*>(mesh.positions.data()), static_cast<std::streamsize>(counts[0] * sizeof(Vec3f)));
    file.read(reinterpret_cast<char*>(triangles.data()),
              static_cast<std::streamsize>(counts[1] * sizeof(TriangleIndices)));
    mesh.triangles = std::move(triangles);
  }
  if (!file) throw std::runtime_error("cannot read " + path);
  return mesh;
}

}  // namespace perfect_bvh::bench
