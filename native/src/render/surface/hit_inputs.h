// The data on hits of a scene's surfaces that nodes may read. In: hits and the appearance. Out: positions, normals,
// layers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "render/surface/object_triangle.h"
#include "render/surface/run_nodes.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

class HitInputs final : public NodeInputs {
 public:
  explicit HitInputs(const Appearance& appearance) : appearance_(appearance) { posed_.reserve(kNodeLanes); }

  void clear() noexcept { count_ = 0, posed_.clear(); }
  // Adds a hit, while there are fewer than kNodeLanes. The arguments must stay valid until the next clear().
  void add(const Instance& instance, const Ray& ray, const Hit& hit, const SurfacePoint& point);
  // Call after the last one: computes the hits' positions, as far as a program needs them.
  void prepare(const NodeNeeds& needs);
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

  void read(NodeInput input, int number, int side, NodeChannel* channels) override;
  [[nodiscard]] Vec3f transformed(std::size_t lane, Vec3f v, VectorKind kind, VectorSpace from,
                                  VectorSpace to) const override;

 private:
  struct Lane {
    const Instance* instance;  // placed at the ray's time
    const Ray* ray;
    const SurfacePoint* point;
    Hit sides[3];     // the hit itself, and the shifted points
    Vec3d places[3];  // in the mesh's stored frame
    Vec3f ways[3];    // vectors to them, in world space; the first is zero
  };

  void find_sides(Lane& lane, float pixels) const;
  [[nodiscard]] double way_aside(const Lane& lane, Vec3d position, float pixels) const noexcept;
  [[nodiscard]] Affine to_world(const Lane& lane, VectorSpace space) const;
  [[nodiscard]] Vec3f in_image(Vec3d position) const;
  [[nodiscard]] Vec3f vector_of(NodeInput input, const Lane& lane, int side) const;
  [[nodiscard]] Vec3f object_normal_of(const Lane& lane) const;
  [[nodiscard]] Rgba tangent_of(const Lane& lane, int uv_map) const;

  const Appearance& appearance_;
  std::array<Lane, kNodeLanes> lanes_;
  std::vector<Instance> posed_;
  std::size_t count_ = 0;
};

}  // namespace perfect_bvh
