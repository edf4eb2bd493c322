// How a strand of hair scatters light: a fiber (hair_fiber.h) and the lobes of Blender's Hair BSDF (hair_lobe.h).
// In: a row of the table, the strand's direction and normal at a hit, the way to the viewer. Out: as of Bsdf, but that
// there is no cosine: a strand is lit from all around.
#pragma once

#include <array>

#include "math/vec3.h"
#include "render/appearance/hair.h"
#include "render/sampling/sampler.h"
#include "render/surface/hair_fiber.h"
#include "render/surface/hair_lobe.h"

namespace perfect_bvh {

class HairBsdf {
 public:
  struct Place {
    Vec3f along, normal, view;  // unit length; along the strand towards its tip
  };

  struct Value {
    Vec3f share{0, 0, 0};  // of the light that comes from there, per solid angle
    float density = 0.0f;  // with which `sample` chooses the direction, over solid angle
  };
  struct Sample {
    Vec3f direction;
    bool passes;  // rather than that it is reflected
  };

  // color: the material's, for what is `colored`. least: no lobe is narrower (see Bsdf::Limits::least_alpha).
  HairBsdf(const Hair& hair, Vec3f color, const Place& place, float least) noexcept;

  [[nodiscard]] Value evaluate(Vec3f direction) const noexcept;
  // As lights see it (see hair_lobe.h).
  [[nodiscard]] Value lit(Vec3f direction) const noexcept;
  // pick: 0 to 1, apart from `random`.
  [[nodiscard]] Sample sample(float pick, Point2 random) const noexcept;
  // All that is scattered.
  [[nodiscard]] Vec3f albedo() const noexcept { return fiber_.albedo() + colors_[0] + colors_[1]; }
  // By what its paths are widened in place of the density (see PathTracer::limits_of); infinite: by that.
  [[nodiscard]] float widening() const noexcept { return widening_; }

 private:
  [[nodiscard]] HairDirection local(Vec3f world) const noexcept;
  [[nodiscard]] Vec3f world(const HairDirection& direction) const noexcept;
  [[nodiscard]] Value evaluate(Vec3f direction, bool is_lit) const noexcept;

  Vec3f normal_;
  Vec3f x_, y_, z_;  // along; towards the viewer, across; aside
  HairFiber fiber_;
  std::array<StrandLobe, 2> lobes_;
  std::array<Vec3f, 2> colors_;  // what is reflected, what passes
  std::array<double, 3> chances_{};
  bool all_reflected_;
  float widening_;
};

}  // namespace perfect_bvh
