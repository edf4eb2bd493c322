// How a strand of hair scatters light: as a dielectric cylinder that absorbs (Marschner et al. 2003). Its lobes are the
// light that is reflected (R), that passes through (TT), that is reflected once inside (TRT), and the rest; each is a
// spread along the fiber (d'Eon et al. 2011) times one around it, a logistic one (Chiang et al. 2016). No light is lost
// but what is absorbed.
// In: a row of the table, the strand's direction and normal at a hit, the way to the viewer. Out: as of Bsdf, but that
// there is no cosine: a strand is lit from all around.
#pragma once

#include <array>

#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// By the sine and cosine of its angle with the plane across the fiber, and the angle around the fiber from the viewer
// on.
struct HairDirection {
  double sine, cosine;  // along the fiber, across it
  double around;        // -pi to pi
};

struct HairValue {
  Vec3f share{0, 0, 0};  // of the light that comes from there, per solid angle
  double density = 0.0;  // with which `sample` chooses the direction, over solid angle
};

// What the base colour absorbs, so that fur of it looks about like it (the fit of Chiang et al. 2016).
[[nodiscard]] Vec3f absorption_of(Vec3f color, float radial_roughness) noexcept;

// In the fiber's own directions.
class HairFiber {
 public:
  static constexpr int kLobes = 4;  // R, TT, TRT, the rest

  // view: the viewer's direction, around 0. aside: -1 to 1, from one edge of the fiber to the other, as the sine of
  // the angle around from the normal to the viewer. least: no lobe is narrower (see Bsdf::Limits::least_alpha).
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
  };

  void set_widths(const Hair& hair, float least) noexcept;
  void set_tilts(const Hair& hair) noexcept;
  void set_middles(double aside, double aside_inside) noexcept;
  void set_shares(const Hair& hair, Vec3f passed, double reflected) noexcept;
  [[nodiscard]] double density_of(const Lobe& lobe, const HairDirection& direction) const noexcept;

  HairDirection view_;
  std::array<Lobe, kLobes> lobes_;
  std::array<Vec3f, kLobes> shares_;  // of the light that is scattered
};

// In world space.
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
  // pick: 0 to 1, apart from `random`.
  [[nodiscard]] Sample sample(float pick, Point2 random) const noexcept;
  // All that is scattered.
  [[nodiscard]] Vec3f albedo() const noexcept { return fiber_.albedo(); }

 private:
  [[nodiscard]] HairDirection local(Vec3f world) const noexcept;
  [[nodiscard]] Vec3f world(const HairDirection& direction) const noexcept;

  Vec3f x_, y_, z_;  // along; towards the viewer, across; aside
  HairFiber fiber_;
};

}  // namespace perfect_bvh
