// Takes a ray to where a turning instance is (math/turn_back.h).
// Kernels include this file: nothing in it may have external linkage.
#pragma once

#include <cstddef>

#include "math/double4.h"
#include "math/turn_back.h"

namespace perfect_bvh {

// Sine and cosine of 0 to half of pi, each as sine_of_quarter() finds it.
PERFECT_BVH_LANES void sine_and_cosine(double angle, double& sine, double& cosine) noexcept {
  constexpr double kQuarter = 1.5707963267948966;
  const Double2 x = {angle, kQuarter - angle};
  const Double2 square = x * x;
  Double2 sum = {kSineSeries[9], kSineSeries[9]};
  for (int i = 8; i >= 0; --i) sum = sum * square + Double2{kSineSeries[i], kSineSeries[i]};
  const Double2 both = x + x * (square * sum);
  sine = both[0], cosine = both[1];
}

// `growth`, which goes on at `share`, applied to v, and v. Of four numbers that are read the last belongs to no column.
PERFECT_BVH_LANES Double4 grown(const TurnBack& turn, double share, const Double4& v) noexcept {
  const char* const columns = reinterpret_cast<const char*>(&turn) + offsetof(TurnBack, growth);
  const Double4 x = load4_widened(columns), y = load4_widened(columns + 12), z = load4_widened(columns + 24);
  return v + all4(share) * ((x * all4(v[0]) + y * all4(v[1])) + z * all4(v[2]));
}

// A ray, in the world times `world_scale`, as the mesh's frame about `centre` times `tree_scale` sees it, at a share of
// the interval. Rays and centre are read with what stands behind their three numbers.
PERFECT_BVH_LANES void turn_ray_back(const TurnBack& turn, double share, const double* centre, double tree_scale,
                                     double world_scale, const double* from_origin, const double* from_direction,
                                     double* origin, double* direction) noexcept {
  double sine, cosine;
  sine_and_cosine(share * turn.half_angle, sine, cosine);
  const Double4 once = all4(2.0 * (sine * cosine)), twice = all4(2.0 * (sine * sine));
  const auto column = [&](int i) __attribute__((always_inline)) {
    const double* const m = turn.maps + 3 * i;
    return (load4(m) + once * load4(m + 9)) + twice * load4(m + 18);
  };
  const Double4 x = column(0), y = column(1), z = column(2);
  const Double4 place = load4(turn.translation) + all4(share) * load4(turn.shift);
  const Double4 away = load4(from_origin) - all4(world_scale) * place;
  Double4 o = (x * all4(away[0]) + y * all4(away[1])) + z * all4(away[2]);
  Double4 d = (x * all4(from_direction[0]) + y * all4(from_direction[1])) + z * all4(from_direction[2]);
  if (turn.grows != 0) o = grown(turn, share, o), d = grown(turn, share, d);
  const Double4 in_tree = all4(tree_scale / world_scale);
  store4(origin, three_of(o * in_tree - load4(centre) * all4(tree_scale)));
  store4(direction, three_of(d * in_tree));
}

}  // namespace perfect_bvh
