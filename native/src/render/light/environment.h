// What surrounds a scene: its world's colour or image, or the studio's sky.
// In: directions. Out: what comes from there if nothing is in the way, in two parts where a light of the image can be
// sampled as a light.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"

namespace perfect_bvh {

// What an image round a scene shows much brighter than the rest, as a sun or a window: a light for next-event
// estimation. In: an equirectangular image. Out: directions in which it is bright, the brighter the more of them, and
// how likely a direction is chosen. The image is sorted into cells of a pixel or a few; cells are chosen by their
// light, first a row and then a cell of it, so that even numbers stay even; within a cell all directions are as likely.
// Only what exceeds a multiple of the image's mean is such a light, and nothing where nothing does: what is less bright
// is found well enough by chance, and an image without contrast takes no rays of its own.
class BrightSky {
 public:
  BrightSky() = default;                         // empty
  BrightSky(const Texture& image, int threads);  // at most so many; 0: all

  // A colour of the image in two: what only the surface's rays find, and what next-event estimation samples, too.
  struct Parts {
    Vec3f plain, bright;
  };
  [[nodiscard]] Parts split(Vec3f color) const noexcept;

  [[nodiscard]] bool empty() const noexcept { return cells_.empty(); }
  struct Choice {
    Vec3f direction;
    float density;  // over solid angle
  };
  // Not to be asked if it is empty.
  [[nodiscard]] Choice choose(Point2 random) const noexcept;
  [[nodiscard]] float density(Vec3f direction) const noexcept;
  // Of the part that only the surface's rays find, over all directions.
  [[nodiscard]] Vec3f mean_plain() const noexcept { return mean_plain_; }

 private:
  struct Cell {
    std::uint32_t column;
    float light;   // in the mean, over its directions
    double total;  // light times solid angle, of this and all before it
  };
  struct Row {
    std::uint32_t number, first, end;  // its cells
    double total;                      // of this and all before it
  };
  struct Strip;  // a row of pixels, summed

  [[nodiscard]] Strip sum(std::span<const Rgba> pixels, int y) const noexcept;
  [[nodiscard]] std::vector<float> spread(const Texture& image, const std::vector<Strip>& strips);
  void list(const std::vector<float>& light);
  [[nodiscard]] double height_at(double row) const noexcept;
  [[nodiscard]] double total() const noexcept { return rows_.back().total; }

  int width_ = 0, height_ = 0;  // of the image
  int cell_ = 1, columns_ = 0;  // sides of a cell in pixels, cells in a row
  float most_plain_ = 0.0f;     // the largest channel of a colour of which no part is bright
  Vec3f mean_plain_{0, 0, 0};
  std::vector<Row> rows_;
  std::vector<Cell> cells_;
};

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
