// Motions of meshes to test refits, gentle and violent; the same in every run.
#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "mesh/mesh.h"

namespace perfect_bvh::test {

using Positions = AlignedVector<Vec3f>;

struct Motion {
  std::string name;
  std::function<void(Positions&)> apply;
};

// Turns the mesh about the x axis by an angle that grows along it.
inline void twist(Positions& positions, float angle) {
  Aabb box;
  for (const Vec3f& p : positions) box.grow(p);
  const float length = box.extent().x > 0 ? box.extent().x : 1.0f;
  for (Vec3f& p : positions) {
    const float turn = angle * ((p.x - box.lower.x) / length);
    const float c = std::cos(turn), s = std::sin(turn);
    p = {p.x, c * p.y - s * p.z, s * p.y + c * p.z};
  }
}

inline void scatter(Positions& positions, float distance, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> offset(-distance, distance);
  for (Vec3f& p : positions) p = p + Vec3f{offset(random), offset(random), offset(random)};
}

inline void scale(Positions& positions, float factor) {
  for (Vec3f& p : positions) p = p * factor;
}

inline std::vector<Motion> motions() {
  const auto shuffle = [](Positions& positions) {
    std::mt19937 random(3);
    for (std::size_t i = positions.size(); i > 1; --i) std::swap(positions[i - 1], positions[random() % i]);
  };
  const auto flatten = [](Positions& positions) {
    for (Vec3f& p : positions) p.y = -0.0f;
  };
  const auto coincide = [](Positions& positions) { positions.assign(positions.size(), {1.0f, -2.0f, 3.0f}); };
  return {{"nothing", [](Positions&) {}},
          {"twist", [](Positions& p) { twist(p, 6.2831853f); }},
          {"explosion", [](Positions& p) { scatter(p, 40.0f, 4); }},
          {"shuffle", shuffle},
          {"flat, at -0", flatten},
          {"one point", coincide},
          {"scale 1e-20", [](Positions& p) { scale(p, 1e-20f); }},
          {"scale 1e-6", [](Positions& p) { scale(p, 1e-6f); }},
          {"scale 1e8", [](Positions& p) { scale(p, 1e8f); }},
          {"scale 1e15", [](Positions& p) { scale(p, 1e15f); }}};
}

}  // namespace perfect_bvh::test
