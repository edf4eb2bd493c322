// What surrounds a scene: its world's colour or image, or the studio's sky.
// In: directions. Out: what comes from there if nothing is in the way, in two parts where a light of the image can be
// sampled as a light (bright_sky.h).
#pragma once

#include <memory>

#include "render/appearance/appearance.h"
#include "render/light/bright_sky.h"

namespace perfect_bvh {

class Environment {
 public:
  Environment(const Appearance& appearance, int threads);

  [[nodiscard]] Vec3f radiance(Vec3f direction) const noexcept;
  // What the camera sees there, which need not light anything.
  [[nodiscard]] Vec3f backdrop(Vec3f direction) const noexcept;
  // Both parts make the radiance.
  [[nodiscard]] BrightSky::Parts parts(Vec3f direction) const noexcept;
  // Of the plain part.
  [[nodiscard]] Vec3f mean() const noexcept { return mean_; }

  // Whether any part is bright.
  [[nodiscard]] bool can_be_aimed_at() const noexcept { return !bright_->empty(); }
  [[nodiscard]] BrightSky::Choice aim(Point2 random) const noexcept;
  // With which that chooses a direction.
  [[nodiscard]] float density(Vec3f direction) const noexcept;

 private:
  [[nodiscard]] const Texture* image() const noexcept;
  [[nodiscard]] std::shared_ptr<const BrightSky> find_bright_sky(int threads) const;
  [[nodiscard]] Vec3f find_mean() const noexcept;

  const Appearance& appearance_;
  std::shared_ptr<const BrightSky> bright_;
  Vec3f mean_;
};

}  // namespace perfect_bvh
