// Where a ray is to an instance that turns: the way back of math/turning.h, made ready for each interval between two
// steps, as long as what is stretched hardly changes between them.
//
// A rotation that turns evenly about one axis k by an angle a is I + sin(x a) K + (1 - cos(x a)) K K at the share x of
// its way, K p being the cross product of k and p. So the inverse of rotation times stretch is a sum of three maps that
// are known beforehand; only sine and cosine are left to be found for each ray, and neither a matrix is inverted nor a
// quaternion normalised. From one step to the next a stretch is seldom another one, but for the rounding of the
// matrices that it comes from: its inverse goes in a straight line from one to the other, which is off by less than
// kMostGrowth squared. math/turn_ray.h does it.
#pragma once

#include <cstdint>

#include "math/turning.h"

namespace perfect_bvh {

// A stretch changes by no more of itself, in any entry.
inline constexpr double kMostGrowth = 0x1p-21;

struct alignas(64) TurnBack {
  // Columns x, y, z of the three maps, one map after another. The last number is only read with others.
  double maps[28];
  double translation[3], shift[3];  // at the step, and from there to the next
  double half_angle;                // of the whole way
  float growth[9];                  // what the inverse is multiplied by at the next step, less 1: columns
  std::uint8_t is_ready;            // 0: rays are to be mapped by TurnStep, and nothing else here means anything
  std::uint8_t grows;               // 0: `growth` is 0
  std::uint8_t is_mirrored;
};
static_assert(sizeof(TurnBack) == 320);

}  // namespace perfect_bvh
