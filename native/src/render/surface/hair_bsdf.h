// The scattering of a strand of hair: a dielectric cylinder that absorbs light (Marschner et al. 2003). Its lobes are
// light that is reflected (R), that passes through (TT), that is reflected once inside (TRT), and the rest. Each is a
// distribution along the fiber (d'Eon et al. 2011) times one around it, a logistic one (Chiang et al. 2016). Light is
// only lost by absorption.
// In: a row of the table, the strand's direction and normal at a hit, the direction to the viewer. Out: as for Bsdf,
// but without a cosine: a strand is lit from all around.
#pragma once

#include <array>

#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// A direction by the sine and cosine of its angle with the plane across the fiber, and the angle around the fiber,
// starting at the viewer.
struct HairDirection {
  double sine, cosine;  // along the fiber, across it
  double around;        // -pi to pi
};

struct HairValue {
  Vec3f share{0, 0, 0};  // of the light from there, per solid angle
  double density = 0.0;  // probability density of the direction in `sample`, over solid angle
};

// Returns an absorption for which fur looks about like the base colour (the fit of Chiang et al. 2016).
[[nodiscard]] Vec3f absorption_of(Vec3f color, float radial_roughness) noexcept;

// In the fiber's own frame.
class HairFiber {
 public:
  static constexpr int kLobes = 4;  // R, TT, TRT, the rest

  // view: the viewer's direction, at angle 0 around. aside: -1 to 1, from one edge of the fiber to the other, the sine
  // of the angle around from the normal to the viewer. least: the minimum width of lobes (see
  // Bsdf::Limits::least_alpha).
  HairFiber(const Hair& hair, Vec3f absorption, const HairDirection& view, double aside, float least) noexcept;

  [[nodiscard]] HairValue evaluate(const HairDirection& direction) const noexcept;
  struct Sample {
    HairDirection direction;
    int lobe;
  };
  [[nodiscard]] Sample sample(double pick, Point2 random) const noexcept;
  [[nodiscard]] Vec3f albedo() const noexcept { return shares_[0] + shares_[1] + shares_[2] + shares_[3]; }

 private:
  struct Lobe {
    double variance = 1.0;  // along
    double scale = 1.0;     // around, of the logistic distribution; 0: even
    double middle = 0.0;    // around
    double sine_of_tilt = 0.0, cosine_of_tilt = 1.0;
    double chance = 0.0;
    double whole_along = 1.0, whole_around = 1.0;  // the integrals of both distributions
  };

  void set_widths(const Hair& hair, float least) noexcept;
  void set_tilts(const Hair& hair) noexcept;
  void set_middles(double aside, double aside_inside) noexcept;
  void set_shares(const Hair& hair, Vec3f passed, double reflected) noexcept;
  [[nodiscard]] double density_of(const Lobe& lobe, const HairDirection& direction) const noexcept;

  HairDirection view_;
  std::array<Lobe, kLobes> lobes_;
  std::array<Vec3f, kLobes> shares_;  // of the scattered light
};

// In world space.
class HairBsdf {
 public:
  struct Place {
    Vec3f along, normal, view;  // unit length; along the strand towards its tip
  };

  struct Value {
    Vec3f share{0, 0, 0};  // of the light from there, per solid angle
    float density = 0.0f;  // probability density of the direction in `sample`, over solid angle
  };
  struct Sample {
    Vec3f direction;
    bool passes;  // transmitted, not reflected
  };

  // color: the material's, for `colored` hair. least: the minimum width of lobes (see Bsdf::Limits::least_alpha).
  HairBsdf(const Hair& hair, Vec3f color, const Place& place, float least) noexcept;

  [[nodiscard]] Value evaluate(Vec3f direction) const noexcept;
  // pick: 0 to 1, independent of `random`.
  [[nodiscard]] Sample sample(float pick, Point2 random) const noexcept;
  // Returns the total share of scattered light.
  [[nodiscard]] Vec3f albedo() const noexcept { return fiber_.albedo(); }

 private:
  [[nodiscard]] HairDirection local(Vec3f world) const noexcept;
  [[nodiscard]] Vec3f world(const HairDirection& direction) const noexcept;

  Vec3f x_, y_, z_;  // along; towards the viewer, across; aside
  HairFiber fiber_;
};

}  // namespace perfect_bvh
