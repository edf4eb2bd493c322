#include "render/filter/film.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/aligned.h"
#include "core/thread_pool.h"
#include "math/elementary.h"

namespace perfect_bvh {
namespace {

// The window over [0, 1]: 1 in the middle, nearly 0 at the ends.
double blackman_harris(double place) noexcept {
  const double c = cosine(2.0 * std::numbers::pi * place);  // of the double and the threefold angle as well:
  return 0.35875 - 0.48829 * c + 0.14128 * (2.0 * c * c - 1.0) - 0.01168 * c * (4.0 * c * c - 3.0);
}

}  // namespace

PixelFilter::PixelFilter(float width)
    : width_(width),
      cells_per_pixel_(width > 0.0f ? static_cast<float>(kCells) / (2.0f * width) : 0.0f),
      reach_(std::max(static_cast<int>(std::ceil(width - 0.5f)), 0)) {
  constexpr int kSteps = 16384;
  std::vector<double> cumulative(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const auto row = static_cast<std::size_t>(i);
    cumulative[row + 1] = cumulative[row] + blackman_harris((i + 0.5) / kSteps);
  }
  std::size_t step = 0;
  for (int cell = 0; cell <= kCells; ++cell) {
    const auto row = static_cast<std::size_t>(cell);
    heights_[row] = static_cast<float>(blackman_harris(static_cast<double>(cell) / kCells));
    const double wanted = cumulative[kSteps] * cell / kCells;
    while (step + 1 < kSteps && cumulative[step + 1] < wanted) ++step;
    const double part = (wanted - cumulative[step]) / (cumulative[step + 1] - cumulative[step]);
    const double place = (static_cast<double>(step) + part) / kSteps;
    inverse_[row] = static_cast<float>((2.0 * place - 1.0) * static_cast<double>(width));
  }
}

void PixelFilter::weigh(float offset, Weights& weights) const noexcept {
  for (int step = -reach_; step <= reach_; ++step) {
    const float place = (static_cast<float>(step) - offset + width_) * cells_per_pixel_;
    const bool inside = place >= 0.0f && place < static_cast<float>(kCells);
    weights[static_cast<std::size_t>(step + reach_)] = inside ? look_up(heights_, place) : 0.0f;
  }
}

Film::Film(const TileGrid& grid, const PixelFilter& filter, bool has_guides)
    : grid_(grid),
      filter_(filter),
      reach_(filter.reach()),
      has_guides_(has_guides),
      tiles_(grid.count()),
      guides_(has_guides ? grid.count() : 0) {}

void Film::begin(std::size_t tile) {
  tiles_[tile].assign(stride() * stride(), Sum{});
  if (has_guides_) guides_[tile].assign(stride() * stride(), Guides{});
}

void Film::add(std::size_t tile, std::span<const Pixel> pixels, std::span<const Point2> offsets,
               std::span<const Rgba> colors, std::span<const Vec3f> albedos, std::span<const Vec3f> normals) noexcept {
  const PixelRect whole = grid_.whole_at(tile);
  const auto taps = static_cast<std::size_t>(2 * reach_ + 1);
  PixelFilter::Weights along_x, along_y;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    filter_.weigh(offsets[i].x, along_x);
    filter_.weigh(offsets[i].y, along_y);
    const Rgba color = colors[i];
    // The tile's border is as wide as the filter's reach, so the first tap is at the pixel's own position in it.
    std::size_t row =
        static_cast<std::size_t>(pixels[i].y - whole.y0) * stride() + static_cast<std::size_t>(pixels[i].x - whole.x0);
    for (std::size_t y = 0; y < taps; ++y, row += stride()) {
      for (std::size_t x = 0; x < taps; ++x) {
        const float weight = along_y[y] * along_x[x];
        Sum& sum = tiles_[tile][row + x];
        sum.color = {sum.color.r + weight * color.r, sum.color.g + weight * color.g, sum.color.b + weight * color.b,
                     sum.color.a + weight * color.a};
        sum.weight += weight;
        if (!has_guides_) continue;
        Guides& guides = guides_[tile][row + x];
        guides.albedo = guides.albedo + albedos[i] * weight;
        guides.normal = guides.normal + normals[i] * weight;
      }
    }
  }
}

FilmColor Film::pixel(int x, int y) const noexcept {
  Sum all;
  Guides guides;
  grid_.visit({std::max(x - reach_, 0), std::max(y - reach_, 0), x + reach_ + 1, y + reach_ + 1},
              [&](std::size_t tile) {
                const PixelRect whole = grid_.whole_at(tile);
                const std::size_t row = static_cast<std::size_t>(y - whole.y0 + reach_) * stride() +
                                        static_cast<std::size_t>(x - whole.x0 + reach_);
                const Sum& sum = tiles_[tile][row];
                all.color = {all.color.r + sum.color.r, all.color.g + sum.color.g, all.color.b + sum.color.b,
                             all.color.a + sum.color.a};
                all.weight += sum.weight;
                if (!has_guides_) return;
                guides.albedo = guides.albedo + guides_[tile][row].albedo;
                guides.normal = guides.normal + guides_[tile][row].normal;
              });
  // Divided, not multiplied, so that a pixel that is opaque in every sample has an alpha of exactly 1.
  const float weight = all.weight;
  return {{all.color.r / weight, all.color.g / weight, all.color.b / weight, all.color.a / weight},
          guides.albedo * (1.0f / weight),
          guides.normal * (1.0f / weight)};
}

// Joint filter --------------------------------------------------------------------------------------------------------

namespace {

constexpr int kLevels = 5;                                           // the last reaches 32 pixels
constexpr float kTaps[] = {3.0f / 8.0f, 1.0f / 4.0f, 1.0f / 16.0f};  // a cubic B-spline, from its middle
constexpr int kVarianceRadius = 3;
// Added to albedo: black surfaces have no light to compare, and light independent of albedo (mirrors) must not be
// amplified.
constexpr float kLeastAlbedo = 0.01f;
constexpr float kAlbedoTolerance = 0.7f;
constexpr float kSpeck = 2.0f;           // the factor by which a single pixel may be brighter than all around it
constexpr float kNoiseTolerance = 6.0f;  // of brightness, in standard deviations
constexpr float kLeastVariance = 1e-8f;

// The values that are filtered: a pixel's colour without the albedo, and the variance of its brightness.
struct NoisyLight {
  Vec3f light{0, 0, 0};
  float variance = 0.0f;
};

// Returns the luminance.
float brightness(Vec3f c) noexcept { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

Vec3f over(Vec3f a, Vec3f b) noexcept { return {a.x / b.x, a.y / b.y, a.z / b.z}; }

// 1 for no difference, 0 from the tolerance on (Tukey's biweight, which avoids a library's rounding of exponentials).
float alike(float squared_difference, float squared_tolerance) noexcept {
  const float rest = 1.0f - squared_difference / squared_tolerance;
  return rest > 0.0f ? rest * rest : 0.0f;
}

class JointFilter {
 public:
  JointFilter(const JointFilterImages& images, int max_threads, CancelToken& cancel)
      : images_(images),
        count_(static_cast<std::size_t>(images.width) * static_cast<std::size_t>(images.height)),
        max_threads_(max_threads),
        cancel_(cancel),
        light_(count_),
        next_(count_),
        normal_(images.normal.empty() ? 0 : count_) {}

  void run() {
    cancel_.expect(static_cast<std::size_t>(images_.height) * (kLevels + 4));
    for_rows([this](int y) { separate(y); });
    for_rows([this](int y) { remove_specks(y); });
    light_.swap(next_);
    for_rows([this](int y) { estimate_variance(y); });
    light_.swap(next_);
    for (int level = 0; level < kLevels; ++level) {
      for_rows([this, level](int y) { average(y, 1 << level); });
      light_.swap(next_);
    }
    for_rows([this](int y) { join(y); });
  }

 private:
  template <class Row>
  void for_rows(const Row& row) {
    constexpr std::size_t kRowsAtOnce = 4;
    parallel_for(
        ThreadPool::shared(), static_cast<std::size_t>(images_.height), kRowsAtOnce,
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t y = begin; y < end; ++y) {
            cancel_.throw_if_stopped();
            row(static_cast<int>(y));
            cancel_.advance(1);
          }
        },
        max_threads_, [this] { cancel_.checkpoint(); });
  }

  [[nodiscard]] std::size_t at(int x, int y) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(images_.width) + static_cast<std::size_t>(x);
  }
  [[nodiscard]] bool inside(int x, int y) const noexcept {
    return x >= 0 && x < images_.width && y >= 0 && y < images_.height;
  }
  [[nodiscard]] Vec3f divisor(std::size_t i) const noexcept {
    if (images_.albedo.empty()) return {1, 1, 1};
    return max(images_.albedo[i], Vec3f{0, 0, 0}) + Vec3f{kLeastAlbedo, kLeastAlbedo, kLeastAlbedo};
  }

  // Returns how similar the surfaces of two pixels are, 0 to 1.
  [[nodiscard]] float kinship(std::size_t a, std::size_t b) const noexcept {
    float share = 1.0f;
    if (!normal_.empty()) {
      const bool a_is_surface = dot(normal_[a], normal_[a]) > 0.0f, b_is_surface = dot(normal_[b], normal_[b]) > 0.0f;
      if (a_is_surface != b_is_surface) return 0.0f;
      if (a_is_surface) {
        share = std::max(0.0f, dot(normal_[a], normal_[b]));
        for (int i = 0; i < 5; ++i) share *= share;  // its 32nd power: a half at 12 degrees
      }
    }
    if (!images_.albedo.empty()) {
      const Vec3f difference = images_.albedo[a] - images_.albedo[b];
      share *= alike(dot(difference, difference), kAlbedoTolerance * kAlbedoTolerance);
    }
    return share;
  }

  void separate(int y) noexcept {
    for (int x = 0; x < images_.width; ++x) {
      const std::size_t i = at(x, y);
      light_[i].light = over(images_.color[i], divisor(i));
      if (normal_.empty()) continue;
      const Vec3f normal = images_.normal[i];
      const float length = std::sqrt(dot(normal, normal));
      normal_[i] = length > 0.01f ? normal * (1.0f / length) : Vec3f{0, 0, 0};
    }
  }

  // Limits a pixel that is much brighter than all eight around it to kSpeck times the brightest of them.
  void remove_specks(int y) noexcept {
    for (int x = 0; x < images_.width; ++x) {
      float most = 0.0f;
      bool is_alone = true;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          if ((dx == 0 && dy == 0) || !inside(x + dx, y + dy)) continue;
          is_alone = false;
          most = std::max(most, brightness(light_[at(x + dx, y + dy)].light));
        }
      }
      const std::size_t i = at(x, y);
      const float own = brightness(light_[i].light);
      next_[i].light = own > kSpeck * most && !is_alone ? light_[i].light * (kSpeck * most / own) : light_[i].light;
    }
  }

  // Returns the variance of the brightness, from the surrounding pixels of the same surface.
  void estimate_variance(int y) noexcept {
    for (int x = 0; x < images_.width; ++x) {
      const std::size_t i = at(x, y);
      float weights = 0.0f, sum = 0.0f, squares = 0.0f;
      const float own = brightness(light_[i].light);  // uses differences to it: squares of large numbers cancel badly
      for (int dy = -kVarianceRadius; dy <= kVarianceRadius; ++dy) {
        for (int dx = -kVarianceRadius; dx <= kVarianceRadius; ++dx) {
          if (!inside(x + dx, y + dy)) continue;
          const std::size_t j = at(x + dx, y + dy);
          const float weight = kinship(i, j), value = brightness(light_[j].light) - own;
          weights += weight, sum += weight * value, squares += weight * value * value;
        }
      }
      next_[i] = light_[i];
      const float mean = sum / weights;  // the pixel itself weighs 1
      next_[i].variance = std::max(0.0f, squares / weights - mean * mean);
    }
  }

  // The variance used for comparing brightness is smoothed too, otherwise single lucky pixels would reject all others.
  [[nodiscard]] float smooth_variance(int x, int y) const noexcept {
    float weights = 0.0f, sum = 0.0f;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (!inside(x + dx, y + dy)) continue;
        const float weight = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
        weights += weight, sum += weight * light_[at(x + dx, y + dy)].variance;
      }
    }
    return sum / weights;
  }

  void average(int y, int step) noexcept {
    for (int x = 0; x < images_.width; ++x) {
      const std::size_t i = at(x, y);
      const float own = brightness(light_[i].light);
      const float tolerance = kNoiseTolerance * kNoiseTolerance * smooth_variance(x, y) + kLeastVariance;
      float weights = 0.0f, variance = 0.0f;
      Vec3f sum{0, 0, 0};
      for (int dy = -2; dy <= 2; ++dy) {
        for (int dx = -2; dx <= 2; ++dx) {
          if (!inside(x + dx * step, y + dy * step)) continue;
          const std::size_t j = at(x + dx * step, y + dy * step);
          const float difference = brightness(light_[j].light) - own;
          const float likeness = alike(difference * difference, tolerance);
          if (!(likeness > 0.0f)) continue;
          const float weight = kTaps[std::abs(dx)] * kTaps[std::abs(dy)] * likeness * kinship(i, j);
          weights += weight, sum = sum + light_[j].light * weight;
          variance += weight * weight * light_[j].variance;
        }
      }
      next_[i] = {sum * (1.0f / weights), variance / (weights * weights)};  // the pixel itself always counts
    }
  }

  void join(int y) noexcept {
    for (int x = 0; x < images_.width; ++x) images_.out[at(x, y)] = light_[at(x, y)].light * divisor(at(x, y));
  }

  const JointFilterImages& images_;
  std::size_t count_;
  int max_threads_;
  CancelToken& cancel_;
  AlignedVector<NoisyLight> light_, next_;
  AlignedVector<Vec3f> normal_;  // of unit length, or zero
};

}  // namespace

void joint_filter(const JointFilterImages& images, int max_threads, CancelToken& cancel) {
  JointFilter(images, max_threads, cancel).run();
}

}  // namespace perfect_bvh
