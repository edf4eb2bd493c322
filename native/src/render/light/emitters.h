// Emissive triangles as lights: next-event estimation samples them, so that rays need not find them by chance. In: a
// snapshot and the appearance of its surfaces. Out: points on them, more of them on brighter ones.
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
  Vec3f radiance{0, 0, 0};  // equal in all directions
  float density = 0.0f;     // probability density of the point, per unit of area
  std::uint32_t mask = 0;   // the rays that see it
};

class EmissiveTriangles {
 public:
  // Lists the triangles that diffuse rays may hit. Lists nothing if they are too many: scenes that emit everywhere are
  // sampled well by the surfaces' own rays.
  EmissiveTriangles(const Snapshot& snapshot, const Appearance& appearance);

  [[nodiscard]] bool empty() const noexcept { return triangles_.empty(); }
  // Must not be empty. time: at which the triangle is seen.
  [[nodiscard]] EmissivePoint choose(float pick, Point2 place, float time) const;
  // Returns EmissivePoint::density on a surface of this instance and row of the material table: 0 if it is not sampled.
  [[nodiscard]] float density(const Instance& instance, std::int32_t material) const noexcept {
    const bool listed = !empty() && !instance.blas->mesh.is_round() && material != kNoMaterial &&
                        (instance.mask & appearance_.diffuse_mask) != 0;
    return listed ? brightness(material) / static_cast<float>(power()) : 0.0f;
  }

 private:
  struct Triangle {
    std::uint32_t instance, primitive;
    float area;  // for sampling: the largest area that it has
  };
  // Returns 0 for materials that are not worth sampling.
  [[nodiscard]] float brightness(std::int32_t material) const noexcept;
  [[nodiscard]] bool may_emit(const Instance& instance) const noexcept;
  // Returns false if there is no room for more.
  bool list(std::uint32_t instance_index);
  [[nodiscard]] double power() const noexcept { return powers_.back(); }

  const Snapshot& snapshot_;
  const Appearance& appearance_;
  std::vector<Triangle> triangles_;
  std::vector<double> powers_;  // of each triangle, cumulative
};

// Environment ---------------------------------------------------------------------------------------------------------
// The surroundings of a scene: its world's colour or image, or the studio's sky.
// In: directions. Out: the unoccluded light from there, in two parts if a light of the image can be sampled.

// The parts of an environment image that are much brighter than the rest, such as a sun or a window: a light for
// next-event estimation. In: an equirectangular image. Out: directions in which it is bright, more of them where it is
// brighter, and their probability density. The image is divided into cells of one or a few pixels. Cells are chosen by
// their light, first a row and then a cell of it, so that stratified numbers stay stratified; within a cell all
// directions are equally likely. Only light above a multiple of the image's mean is included, and nothing if there is
// none. Darker parts are found well enough by chance, and an image without contrast gets no extra rays.
class BrightSky {
 public:
  BrightSky() = default;                         // empty
  BrightSky(const Texture& image, int threads);  // at most this many threads; 0: all

  // A colour of the image in two parts: one that only the surface's rays find, and one that next-event estimation
  // samples, too.
  struct Parts {
    Vec3f plain, bright;
  };
  [[nodiscard]] Parts split(Vec3f color) const noexcept;

  [[nodiscard]] bool empty() const noexcept { return cells_.empty(); }
  struct Choice {
    Vec3f direction;
    float density;  // over solid angle
  };
  // Must not be empty.
  [[nodiscard]] Choice choose(Point2 random) const noexcept;
  [[nodiscard]] float density(Vec3f direction) const noexcept;
  // Returns the mean, over all directions, of the part that only the surface's rays find.
  [[nodiscard]] Vec3f mean_plain() const noexcept { return mean_plain_; }

 private:
  struct Cell {
    std::uint32_t column;
    float light;   // mean over its directions
    double total;  // light times solid angle, of this cell and all before it
  };
  struct Row {
    std::uint32_t number, first, end;  // its cells
    double total;                      // of this row and all before it
  };
  struct Strip;  // a row of pixels, summed

  [[nodiscard]] Strip sum(std::span<const Rgba> pixels, int y) const noexcept;
  [[nodiscard]] std::vector<float> spread(const Texture& image, const std::vector<Strip>& strips);
  void list(const std::vector<float>& light);
  [[nodiscard]] double height_at(double row) const noexcept;
  [[nodiscard]] double total() const noexcept { return rows_.back().total; }

  int width_ = 0, height_ = 0;  // of the image
  bool is_sky_ = false;         // of its extension
  int cell_ = 1, columns_ = 0;  // sides of a cell in pixels, cells in a row
  float most_plain_ = 0.0f;     // the largest channel of a colour without a bright part
  Vec3f mean_plain_{0, 0, 0};
  std::vector<Row> rows_;
  std::vector<Cell> cells_;
};

class Environment {
 public:
  Environment(const Appearance& appearance, int threads);

  [[nodiscard]] Vec3f radiance(Vec3f direction) const noexcept;
  // Returns the colour that the camera sees there, which need not light anything.
  [[nodiscard]] Vec3f backdrop(Vec3f direction) const noexcept;
  // Returns both parts, which add up to the radiance.
  [[nodiscard]] BrightSky::Parts parts(Vec3f direction) const noexcept;
  // Returns the mean of the plain part.
  [[nodiscard]] Vec3f mean() const noexcept { return mean_; }

  // Returns whether any part is bright.
  [[nodiscard]] bool can_be_aimed_at() const noexcept { return !bright_->empty(); }
  [[nodiscard]] BrightSky::Choice aim(Point2 random) const noexcept;
  // Returns the probability density of a direction in aim().
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
