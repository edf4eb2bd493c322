// The lobes of Blender's Hair BSDF: light that a strand reflects, or lets through, spread along it about the mirrored
// direction like a Cauchy distribution, and around it like a cosine or, let through, like a Cauchy distribution again.
// In: a lobe of the table, the viewer's direction. Out: for a direction, the density over solid angle, which times the
// lobe's colour is what is seen from there; or a direction by that chance.
#pragma once

#include "render/appearance/hair.h"
#include "render/sampling/sampler.h"
#include "render/surface/hair_fiber.h"

namespace perfect_bvh {

class StrandLobe {
 public:
  StrandLobe() = default;
  // least: it is not narrower (see Bsdf::Limits::least_alpha).
  StrandLobe(const HairLobe& lobe, bool passes, const HairDirection& view, float least) noexcept;

  // With which `sample` chooses the direction.
  [[nodiscard]] double density(const HairDirection& direction) const noexcept;
  // The same as lights see it, which differs in Cycles: what passes is lit from the other side of the surface alone,
  // and what is reflected not by what stands behind the viewed side but before the surface.
  [[nodiscard]] double lit(const HairDirection& direction, bool is_beyond) const noexcept;
  [[nodiscard]] HairDirection sample(Point2 random) const noexcept;

 private:
  [[nodiscard]] double along(const HairDirection& direction) const noexcept;
  [[nodiscard]] double around(double angle) const noexcept;

  bool passes_ = false;
  double along_ = 0.1, across_ = 0.1, offset_ = 0.0;
  double view_ = 0.0;                // the viewer's angle with the plane across the strand
  double first_ = 0.0, last_ = 0.0;  // what directions along the strand range over, as arc tangents
  double half_around_ = 0.0;         // the same around it, of what passes
};

}  // namespace perfect_bvh
