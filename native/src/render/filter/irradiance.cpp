#include "render/filter/irradiance.h"

#include <algorithm>
#include <cmath>

namespace perfect_bvh {
namespace {

// How far from the plane through one point another may lie, in pixels there.
constexpr float kPlaneTolerance = 1.5f;
constexpr float kLeastCosine = 0.9f;

// The pixels that a tile's averages need, a plane a quantity: loops over a row of them vectorise.
enum Plane : int {
  kNormalX,
  kNormalY,
  kNormalZ,
  kPositionX,
  kPositionY,
  kPositionZ,
  kInverseTolerance,
  kLight,
};
constexpr int kLightPlanes = 5;                // the members of LightSample
constexpr int kMeans = kLight + kLightPlanes;  // the light again, averaged along rows
constexpr int kPlaneCount = kMeans + kLightPlanes;
constexpr int kSumCount = 1 + kLightPlanes;  // the weight, then the light

// A tile with `radius` pixels around it.
struct Window {
  int x0, y0, width, height;
  float* data;

  [[nodiscard]] std::size_t plane_size() const noexcept {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] float* row(int plane, int y) const noexcept {
    return data + static_cast<std::size_t>(plane) * plane_size() +
           static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
  // A pixel that is not on a surface gets a zero normal, and so weighs nothing.
  void set(int x, int y, const LightPixel& p) const noexcept {
    const float tolerance = p.on_surface() ? 1.0f / (kPlaneTolerance * p.footprint) : 0.0f;
    const float values[kMeans] = {p.normal.x,    p.normal.y,    p.normal.z,  p.position.x,
                                  p.position.y,  p.position.z,  tolerance,   p.light.sky.x,
                                  p.light.sky.y, p.light.sky.z, p.light.key, p.light.key_open};
    for (int plane = 0; plane < kMeans; ++plane) row(plane, y)[x] = values[plane];
  }
};

// Sums of `count` pixels, a row each: the weight, then the light times the weight. Parameters, because compilers
// believe `restrict` there only, and vectorise the loop below only if the sums are known to overlap nothing.
struct Tap {
  const float *nx, *ny, *nz, *px, *py, *pz, *tolerance;  // the pixels that collect
  const float *mx, *my, *mz, *qx, *qy, *qz;              // those that they look at
  const float *a, *b, *c, *d, *e;                        // whose light this is
};
void add_weighted(const Tap t, int count, float share, float* __restrict weights, float* __restrict a,
                  float* __restrict b, float* __restrict c, float* __restrict d, float* __restrict e) noexcept {
  for (int i = 0; i < count; ++i) {
    const float off = t.nx[i] * (t.qx[i] - t.px[i]) + t.ny[i] * (t.qy[i] - t.py[i]) + t.nz[i] * (t.qz[i] - t.pz[i]);
    // x + |x| is twice the larger of x and 0.
    const float near = 1.0f - std::abs(off) * t.tolerance[i];
    const float cosine = t.nx[i] * t.mx[i] + t.ny[i] * t.my[i] + t.nz[i] * t.mz[i];
    float alike = 0.5f * (cosine + std::abs(cosine));
    alike *= alike, alike *= alike, alike *= alike;
    const float weight = share * (near + std::abs(near)) * alike;
    weights[i] += weight;
    a[i] += weight * t.a[i];
    b[i] += weight * t.b[i];
    c[i] += weight * t.c[i];
    d[i] += weight * t.d[i];
    e[i] += weight * t.e[i];
  }
}

// Adds, for `count` pixels of row y from x on, what the pixels (dx, dy) further on say.
void add_tap(const Window& window, int light, int x, int y, int dx, int dy, int count, float share,
             std::span<float> sums) noexcept {
  const auto here = [&](int plane) { return window.row(plane, y) + x; };
  const auto there = [&](int plane) { return window.row(plane, y + dy) + x + dx; };
  const Tap tap{here(kNormalX),    here(kNormalY),          here(kNormalZ),    here(kPositionX), here(kPositionY),
                here(kPositionZ),  here(kInverseTolerance), there(kNormalX),   there(kNormalY),  there(kNormalZ),
                there(kPositionX), there(kPositionY),       there(kPositionZ), there(light),     there(light + 1),
                there(light + 2),  there(light + 3),        there(light + 4)};
  float* const out = sums.data();
  add_weighted(tap, count, share, out, out + count, out + 2 * count, out + 3 * count, out + 4 * count, out + 5 * count);
}

// Half of the outermost pixels: the window then covers whole blocks of complementary samples.
float tap_share(int offset, int radius) noexcept { return std::abs(offset) == radius ? 0.5f : 1.0f; }

// Averages the light of a window's row along x, for the tile's columns.
void average_row(const Window& window, int y, int radius, std::span<float> sums) noexcept {
  const int count = window.width - 2 * radius;
  std::fill(sums.begin(), sums.end(), 0.0f);
  for (int dx = -radius; dx <= radius; ++dx) {
    add_tap(window, kLight, radius, y, dx, 0, count, tap_share(dx, radius), sums);
  }
  for (int plane = 0; plane < kLightPlanes; ++plane) {
    float* const mean = window.row(kMeans + plane, y) + radius;
    const float* const sum = sums.data() + (plane + 1) * count;
    for (int i = 0; i < count; ++i)
      mean[i] = sums[static_cast<std::size_t>(i)] > 0.0f ? sum[i] / sums[static_cast<std::size_t>(i)] : 0.0f;
  }
}

// Averages those averages along y, into a row of the tile. The key light's visibility is a quotient of sums, so that
// pixels turned away from it have no say; each pixel keeps its own cosine.
void average_column(const Window& window, int y, int radius, std::span<float> sums,
                    std::span<LightPixel> out) noexcept {
  const int count = window.width - 2 * radius;
  std::fill(sums.begin(), sums.end(), 0.0f);
  for (int dy = -radius; dy <= radius; ++dy) {
    add_tap(window, kMeans, radius, y, 0, dy, count, tap_share(dy, radius), sums);
  }
  const auto sum = [&](int plane, std::size_t i) { return sums[static_cast<std::size_t>(plane * count) + i]; };
  for (std::size_t i = 0; i < out.size(); ++i) {
    LightPixel& pixel = out[i];
    if (!pixel.on_surface() || !(sum(0, i) > 0.0f)) continue;
    pixel.light.sky = Vec3f{sum(1, i), sum(2, i), sum(3, i)} * (1.0f / sum(0, i));
    if (sum(5, i) > 0.0f) pixel.light.key = pixel.light.key_open * sum(4, i) / sum(5, i);
  }
}

}  // namespace

bool same_surface(const LightPixel& a, Vec3f position, Vec3f normal) noexcept {
  return std::abs(dot(a.normal, position - a.position)) <= kPlaneTolerance * a.footprint &&
         dot(a.normal, normal) >= kLeastCosine;
}

DemodulatedIrradiance::DemodulatedIrradiance(PixelRect area)
    : area_(area), pixels_(static_cast<std::size_t>(area.width()) * static_cast<std::size_t>(area.height())) {}

void DemodulatedIrradiance::smooth(PixelRect tile, int radius, SmoothingScratch& scratch,
                                   std::span<LightPixel> out) const {
  Window window{tile.x0 - radius, tile.y0 - radius, tile.width() + 2 * radius, tile.height() + 2 * radius, nullptr};
  scratch.window.resize(kPlaneCount * window.plane_size());
  window.data = scratch.window.data();
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      const int image_x = window.x0 + x, image_y = window.y0 + y;
      const bool inside = image_x >= area_.x0 && image_x < area_.x1 && image_y >= area_.y0 && image_y < area_.y1;
      window.set(x, y, inside ? pixels_[row_of(image_x, image_y)] : LightPixel{});
    }
  }
  const int count = tile.width();
  scratch.sums.resize(static_cast<std::size_t>(kSumCount * count));
  for (int y = 0; y < window.height; ++y) average_row(window, y, radius, scratch.sums);
  for (int y = 0; y < tile.height(); ++y) {
    const auto row = out.subspan(static_cast<std::size_t>(y * count), static_cast<std::size_t>(count));
    for (int x = 0; x < count; ++x) row[static_cast<std::size_t>(x)] = pixels_[row_of(tile.x0 + x, tile.y0 + y)];
    average_column(window, y + radius, radius, scratch.sums, row);
  }
}

}  // namespace perfect_bvh
