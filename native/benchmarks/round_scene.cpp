#include "round_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <random>
#include <stdexcept>
#include <utility>

#include "mesh/round_mesh.h"
#include "our_rays.h"
#include "query/round_surface.h"

namespace perfect_bvh::bench {
namespace {

constexpr std::uint32_t kSides = 6;

template <class T>
std::vector<T> read_rows(std::ifstream& file, std::size_t count) {
  std::vector<T> rows(count);
  file.read(reinterpret_cast<char*>(rows.data()), static_cast<std::streamsize>(count * sizeof(T)));
  return rows;
}

using Ring = std::array<Vec3f, kSides>;

// Returns points on a circle around a centre, at right angles to the curve's direction there.
Ring ring_around(Vec3d centre, Vec3d along, double radius) {
  const Vec3d way = normalized(along);
  const Vec3d least = std::abs(way.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d across = normalized(cross(way, least)), beside = cross(way, across);
  Ring ring;
  for (std::uint32_t side = 0; side < kSides; ++side) {
    const double turn = 2 * 3.14159265358979 * side / kSides;
    ring[side] = to_float(centre + (across * std::cos(turn) + beside * std::sin(turn)) * radius);
  }
  return ring;
}

void add_tube(const RoundScene& scene, std::size_t first, std::size_t end, Mesh& mesh,
              AlignedVector<TriangleIndices>& triangles) {
  for (std::size_t ball = first; ball < end; ++ball) {
    const std::size_t before = ball > first ? ball - 1 : ball, after = ball + 1 < end ? ball + 1 : ball;
    const Vec3d along = to_double(scene.centres[after]) - to_double(scene.centres[before]);
    const auto row = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec3f& corner :
         ring_around(to_double(scene.centres[ball]), along, static_cast<double>(scene.radii[ball])))
      mesh.positions.push_back(corner);
    if (ball == first) continue;
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const std::uint32_t next = (side + 1) % kSides, a = row - kSides + side, b = row - kSides + next;
      triangles.push_back({a, b, row + next});
      triangles.push_back({a, row + next, row + side});
    }
  }
}

void add_octahedron(Vec3f centre, float radius, Mesh& mesh, AlignedVector<TriangleIndices>& triangles) {
  const auto row = static_cast<std::uint32_t>(mesh.positions.size());
  for (const float sign : {-radius, radius}) {
    mesh.positions.push_back(centre + Vec3f{sign, 0, 0});
    mesh.positions.push_back(centre + Vec3f{0, sign, 0});
    mesh.positions.push_back(centre + Vec3f{0, 0, sign});
  }
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    const std::uint32_t x = row + (corner & 1 ? 3 : 0), y = row + (corner & 2 ? 4 : 1), z = row + (corner & 4 ? 5 : 2);
    triangles.push_back({x, y, z});
  }
}

}  // namespace

RoundScene read_round_scene(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const auto counts = read_rows<std::uint32_t>(file, 3);
  RoundScene scene;
  if (file) {
    for (const Ball& ball : read_rows<Ball>(file, counts[0])) {
      scene.centres.push_back(ball.centre), scene.radii.push_back(ball.radius);
    }
    for (const std::uint32_t first : read_rows<std::uint32_t>(file, counts[1])) scene.offsets.push_back(first);
    for (std::uint32_t i = 0; i < counts[2]; ++i) scene.frames.push_back(read_rows<Vec3f>(file, counts[0]));
  }
  if (!file) throw std::runtime_error("cannot read " + path);
  if (scene.has_curves()) scene.offsets.push_back(counts[0]);
  const BallsGiven<float> balls{scene.centres, scene.radii};
  scene.mesh = scene.has_curves() ? make_curves(balls, scene.offsets, CurveShape::kRound, "read_round_scene")
                                  : make_points(balls, "read_round_scene");
  return scene;
}

Mesh tessellated(const RoundScene& scene) {
  Mesh mesh;
  AlignedVector<TriangleIndices> triangles;
  for (std::size_t curve = 0; curve + 1 < scene.offsets.size(); ++curve) {
    const auto first = static_cast<std::size_t>(scene.offsets[curve]);
    add_tube(scene, first, static_cast<std::size_t>(scene.offsets[curve + 1]), mesh, triangles);
  }
  if (!scene.has_curves()) {
    for (std::size_t i = 0; i < scene.centres.size(); ++i)
      add_octahedron(scene.centres[i], scene.radii[i], mesh, triangles);
  }
  mesh.triangles = std::move(triangles);
  return mesh;
}

std::vector<RaySet> make_round_ray_sets(const Snapshot& snapshot, View view, std::uint32_t width,
                                        std::uint32_t height) {
  const Aabb box = snapshot.bounds;
  const auto diagonal = static_cast<double>(length(box.extent()));
  std::vector<Ray> primary = primary_rays(box, view, width, height), diffuse, occlusion;
  std::vector<Hit> hits(primary.size());
  OurRays(std::shared_ptr<const Snapshot>(&snapshot, [](const Snapshot*) {})).answer(primary, {}, std::span(hits));
  std::mt19937 random(5);
  RoundPlacer placer;
  for (std::size_t i = 0; i < primary.size(); ++i) {
    if (!hits[i].found()) continue;
    const RoundPoint at = placer.place(snapshot.instances.front(), hits[i], primary[i]);
    if (dot(at.normal, at.normal) < 0.5) continue;
    const Vec3d normal = dot(at.normal, primary[i].direction) > 0 ? -at.normal : at.normal;
    const Vec3d origin = at.position + normal * (1e-5 * diagonal);
    diffuse.push_back(diffuse_ray(origin, normal, random));
    occlusion.push_back(diffuse_ray(origin, normal, random));
    occlusion.back().t_max = static_cast<float>(0.1 * diagonal);
  }
  std::vector<Ray> shuffled = diffuse;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(7));
  return {{"primary", {false, true}, std::move(primary)},
          {"diffuse", {false, false}, std::move(diffuse)},
          {"shuffled", {false, false}, std::move(shuffled)},
          {"occlusion", {true, false}, std::move(occlusion)}};
}

}  // namespace perfect_bvh::bench
