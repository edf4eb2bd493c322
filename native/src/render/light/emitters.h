// Emissive triangles as lights: next-event estimation samples them, so that rays need not find them by
// chance. In: a snapshot and what its surfaces look like. Out: places on them, the brighter the more of them.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/appearance/appearance.h"
#include "render/sampling/sampler.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

struct EmissivePoint {
  Vec3d position{0, 0, 0};
  Vec3f normal{0, 0, 0};    // unit length; it emits to both sides
  Vec3f radiance{0, 0, 0};  // towards everywhere
  float density = 0.0f;     // with which such places are chosen, for each unit of area
  std::uint32_t mask = 0;   // by which rays see it
};

class EmissiveTriangles {
 public:
  // Lists what diffuse rays may meet. Nothing is listed if that would be too much: scenes that emit all over are well
  // served by the surfaces' own rays.
  EmissiveTriangles(const Snapshot& snapshot, const Appearance& appearance);

  [[nodiscard]] bool empty() const noexcept { return triangles_.empty(); }
  // Not to be asked if it is empty. time: at which it is seen.
  [[nodiscard]] EmissivePoint choose(float pick, Point2 place, float time) const;
  // As in an EmissivePoint on a surface of this instance and row of the material table: 0 where none is chosen.
  [[nodiscard]] float density(const Instance& instance, std::int32_t material) const noexcept {
    const bool listed = !empty() && !instance.blas->mesh.is_round() && material != kNoMaterial &&
                        (instance.mask & appearance_.diffuse_mask) != 0;
    return listed ? brightness(material) / static_cast<float>(power()) : 0.0f;
  }

 private:
  struct Triangle {
    std::uint32_t instance, primitive;
    float area;  // by which it is chosen: the largest that it has
  };
  // 0 of what is not worth aiming at.
  [[nodiscard]] float brightness(std::int32_t material) const noexcept;
  [[nodiscard]] bool may_emit(const Instance& instance) const noexcept;
  // False if there is no room for more.
  bool list(std::uint32_t instance_index);
  [[nodiscard]] double power() const noexcept { return powers_.back(); }

  const Snapshot& snapshot_;
  const Appearance& appearance_;
  std::vector<Triangle> triangles_;
  std::vector<double> powers_;  // of each triangle, added up
};

// Environment ---------------------------------------------------------------------------------------------------------
// What surrounds a scene: its world's colour or image, or the studio's sky.
// In: directions. Out: what comes from there if nothing is in the way, in two parts where a light of the image can be
// sampled as a light.

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
