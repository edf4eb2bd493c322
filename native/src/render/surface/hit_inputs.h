// What nodes may know of hits on a scene's surfaces. In: hits and the appearance. Out: places, normals, layers.
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
  // One more, as long as there are fewer than kNodeLanes. What it refers to is kept until the next clear().
  void add(const Instance& instance, const Ray& ray, const Hit& hit, const SurfacePoint& point);
  // Call after the last one: works out where hits lie, as far as a program needs that.
  void prepare(const NodeNeeds& needs);
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

  void read(NodeInput input, int number, int side, NodeChannel* channels) override;
  [[nodiscard]] Vec3f transformed(std::size_t lane, Vec3f v, VectorKind kind, VectorSpace from,
                                  VectorSpace to) const override;

 private:
  struct Lane {
    const Instance* instance;  // where it stands at the ray's time
    const Ray* ray;
    const SurfacePoint* point;
    Hit sides[3];     // the hit itself, and the places beside it
    Vec3d places[3];  // in the mesh's stored frame
    Vec3f ways[3];    // to them, in world space; the first is zero
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
