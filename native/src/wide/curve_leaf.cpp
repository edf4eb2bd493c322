// How exact it is, in steps. A coordinate is subtracted, multiplied and rounded to a whole number: with u = 2^-24 that
// moves it by less than .5 + 3 * 1024 u < .5002 on each axis, so a centre by less than .8664. A radius grows by more:
// by .8671, the products' roundings, and to the next whole number.
#include "wide/curve_leaf.h"

#include <algorithm>
#include <array>

#include "math/float4.h"
#include "wide/leaf_block.h"

namespace perfect_bvh {
namespace {

constexpr float kMostSteps = 1023.0f;   // of ten bits
constexpr float kMostRadius = 250.0f;   // with all that it grows by, of eight
constexpr float kMostInUnit = 0x1p48f;  // so that no product of steps leaves the range of float

// The balls at one end of eight segments, as rows: x, y, z, radii of the first four, then of the others.
using BallRows = std::array<Float4, 8>;

[[nodiscard]] BallRows to_rows(std::array<Float4, 8> balls) noexcept {
  transpose(balls[0], balls[1], balls[2], balls[3]);
  transpose(balls[4], balls[5], balls[6], balls[7]);
  return balls;
}

[[nodiscard]] float steps_for(float extent, float radius) noexcept {
  const float of_axes = extent > 0.0f ? kMostSteps / extent : kMostInUnit;
  const float of_radii = radius > 0.0f ? kMostRadius / radius : kMostInUnit;
  return std::min({of_axes, of_radii, kMostInUnit});
}

// Of four centres.
void write_words(const Float4* rows, const CurveLeaf& leaf, std::uint32_t* words) noexcept {
  const Float4 steps(leaf.corner.steps), half(0.5f);
  const auto rounded = [&](int axis) { return truncate((rows[axis] - Float4(leaf.corner.at[axis])) * steps + half); };
  (rounded(0) | rounded(1) << 10 | rounded(2) << 20).store(words);
}

}  // namespace

void write_axes(CurveLeaf& leaf, const Mesh& mesh, float scale) noexcept {
  std::array<Float4, 8> first, last;
  Box4 box = Box4::empty();  // of the centres; the fourth: of the radii
  for (std::size_t lane = 0; lane < 8; ++lane) {
    const Ball* const ball = &mesh.balls[mesh.segments[leaf.primitives[lane]] & kSegmentBall];
    first[lane] = Float4::load(ball) * Float4(scale), last[lane] = Float4::load(ball + 1) * Float4(scale);
    box.grow(first[lane]), box.grow(last[lane]);
  }
  alignas(16) std::array<float, 4> lower, upper, extent;
  box.lower.store(&lower[0]), box.upper.store(&upper[0]), (box.upper - box.lower).store(&extent[0]);
  for (std::size_t axis = 0; axis < 3; ++axis) leaf.corner.at[axis] = lower[axis] + 0.0f;  // no -0
  leaf.corner.steps = steps_for(std::max({extent[0], extent[1], extent[2]}), upper[3]);
  // While a tree is refitted coordinates may leave the range of its scale: then it is refitted once more, in another.
  if (!(leaf.corner.steps * (extent[0] + extent[1] + extent[2] + upper[3]) < 1e6f)) return;
  const BallRows firsts = to_rows(first), lasts = to_rows(last);
  for (std::size_t half = 0; half < 8; half += 4) {
    write_words(&firsts[half], leaf, &leaf.first[half]);
    write_words(&lasts[half], leaf, &leaf.last[half]);
    constexpr float kRoundedUp = 1.0f + 0x1p-20f, kMoved = 1.8671f;
    const Float4 radius =
        max(firsts[half + 3], lasts[half + 3]) * Float4(leaf.corner.steps * kRoundedUp) + Float4(kMoved);
    alignas(16) std::array<std::int32_t, 4> radii;
    truncate(radius).store(&radii[0]);
    for (std::size_t i = 0; i < 4; ++i) leaf.radii[half + i] = static_cast<std::uint8_t>(radii[i]);
  }
}

CurveLeaf make_curve_leaf(const std::uint32_t* primitives, std::uint32_t count, const Mesh& mesh,
                          float scale) noexcept {
  CurveLeaf leaf{};
  write_sorted(primitives, count, leaf.primitives);
  leaf.lanes = (1u << count) - 1;
  write_axes(leaf, mesh, scale);
  return leaf;
}

}  // namespace perfect_bvh
