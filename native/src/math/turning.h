// Moving data is given at evenly spaced moments, its steps. It is interpolated between two steps, and constant before
// the first and after the last.
//
// Positions and boxes move in straight lines. Both are interpolated by the same operations, fl(later * b + fl(earlier *
// a)), which increase with a and with b, including rounding. So if a box contains a vertex at both steps, it contains
// the computed vertex at every time between. At a step itself, nothing is interpolated.
#pragma once

#include <cstddef>
#include <cstdint>

#include "math/double4.h"

namespace perfect_bvh {

struct StepTimes {
  float begin = 0.0f;
  float rate = 1.0f;  // steps per unit of time
  std::uint32_t last = 0;
};

// A moment at a step, or between it and the next: two shares that add up to 1, neither 0. At a step: 1 and 0.
struct Moment {
  std::uint32_t step = 0;
  float earlier = 1.0f, later = 0.0f;

  [[nodiscard]] bool is_between() const noexcept { return later != 0.0f; }
};

// Kernels include this file: nothing in it may have external linkage. `time` is not NaN.
static inline __attribute__((always_inline)) Moment moment_at(const StepTimes& times, float time) noexcept {
  const float at = (time - times.begin) * times.rate;
  if (!(at > 0.0f)) return {};
  if (at >= static_cast<float>(times.last)) return {times.last, 1.0f, 0.0f};
  const auto step = static_cast<std::uint32_t>(at);
  const float later = at - static_cast<float>(step);
  return {step, 1.0f - later, later};
}

static inline float interpolate(const Moment& moment, float a, float b) noexcept {
  return __builtin_fmaf(moment.later, b, moment.earlier * a);
}

// Returns the time of a step.
static inline double time_of(const StepTimes& times, std::uint32_t step) noexcept {
  return static_cast<double>(times.begin) + static_cast<double>(step) / static_cast<double>(times.rate);
}

// Turning -------------------------------------------------------------------------------------------------------------
// The placement of a moving instance: a transform between two of its steps (lecture, "Rigid motion").
//
// Each step's matrix is decomposed into a rotation and the rest, a stretch (Shoemake and Duff 1992, "Matrix animation
// and polar decomposition"). Between steps, the rotation turns evenly in the shorter direction (Shoemake 1985,
// "Animating rotation with quaternion curves"); stretch and translation are linear. Motion blur in Blender and Cycles
// does the same. A wheel stays round, which it would not with interpolated matrices. A turn by more than half a
// revolution between two steps is interpreted as the shorter turn in the other direction: it needs more steps.
//
// Uses doubles and fixed operations: the same bits on every instruction set. Kernels include this file: nothing in it
// may have external linkage.

// One step.
struct TurnStep {
  double rotation[4];  // a quaternion, real part first; its sign is the one nearer to the previous step's
  double stretch[9];   // columns
  double translation[3];
  // The angle to the next step's quaternion, which is half the angle of the rotation.
  double angle, over_sine;  // 1 / its sine, or 0 if it is so small that linear interpolation is as good
};

// The linear part's columns, and the translation.
struct TurnedPlace {
  double columns[9];
  double translation[3];
};

static constexpr double kSineSeries[] = {-1.0 / 6.0,
                                         1.0 / 120.0,
                                         -1.0 / 5040.0,
                                         1.0 / 362880.0,
                                         -1.0 / 39916800.0,
                                         1.0 / 6227020800.0,
                                         -1.0 / 1307674368000.0,
                                         1.0 / 355687428096000.0,
                                         -1.0 / 121645100408832000.0,
                                         1.0 / 51090942171709440000.0};

// For angles from 0 to half of pi; within a unit in the last place.
static inline double sine_of_quarter(double angle) noexcept {
  const double square = angle * angle;
  double sum = kSineSeries[9];
  for (int i = 8; i >= 0; --i) sum = sum * square + kSineSeries[i];
  return angle + angle * (square * sum);
}

// Computes rotation * stretch. The quaternion may have any length except 0.
static inline void turn(const double q[4], const double stretch[9], double columns[9]) noexcept {
  const double scale = 2.0 / ((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]));
  const double x = q[1] * scale, y = q[2] * scale, z = q[3] * scale;
  const double rows[9] = {1.0 - (y * q[2] + z * q[3]), x * q[2] - z * q[0],         x * q[3] + y * q[0],
                          x * q[2] + z * q[0],         1.0 - (x * q[1] + z * q[3]), y * q[3] - x * q[0],
                          x * q[3] - y * q[0],         y * q[3] + x * q[0],         1.0 - (x * q[1] + y * q[2])};
  for (int column = 0; column < 3; ++column) {
    const double* const s = stretch + 3 * column;
    for (int row = 0; row < 3; ++row) {
      const double* const r = rows + 3 * row;
      columns[3 * column + row] = (r[0] * s[0] + r[1] * s[1]) + r[2] * s[2];
    }
  }
}

// Interpolates at a moment; `steps` are all of an instance's.
static inline void place_between(const TurnStep* steps, const Moment& moment, TurnedPlace& place) noexcept {
  const TurnStep& from = steps[moment.step];
  if (!moment.is_between()) {
    turn(from.rotation, from.stretch, place.columns);
    for (int i = 0; i < 3; ++i) place.translation[i] = from.translation[i];
    return;
  }
  const TurnStep& to = (&from)[1];
  const double later = static_cast<double>(moment.later), earlier = 1.0 - later;
  const double first = from.over_sine == 0.0 ? earlier : sine_of_quarter(earlier * from.angle) * from.over_sine;
  const double second = from.over_sine == 0.0 ? later : sine_of_quarter(later * from.angle) * from.over_sine;
  double q[4], stretch[9];
  for (int i = 0; i < 4; ++i) q[i] = first * from.rotation[i] + second * to.rotation[i];
  for (int i = 0; i < 9; ++i) stretch[i] = earlier * from.stretch[i] + later * to.stretch[i];
  turn(q, stretch, place.columns);
  for (int i = 0; i < 3; ++i) place.translation[i] = earlier * from.translation[i] + later * to.translation[i];
}

// Turn back -----------------------------------------------------------------------------------------------------------
// Maps a ray to a turning instance: the inverse of math/turning.h, prepared for each interval between two steps in
// which the stretch hardly changes.
//
// A rotation that turns evenly about one axis k by an angle a is I + sin(x a) K + (1 - cos(x a)) K K at the share x of
// the turn, where K p is the cross product of k and p. So the inverse of rotation times stretch is a sum of three maps
// that are known in advance. Only sine and cosine are computed for each ray; no matrix is inverted and no quaternion is
// normalized. The stretch rarely changes from one step to the next, except for the rounding of the input matrices. Its
// inverse is interpolated linearly, which is off by less than kMostGrowth squared. math/turning.h does it.

// The maximum relative change of a stretch, in any entry.
inline constexpr double kMostGrowth = 0x1p-21;

struct alignas(64) TurnBack {
  // Columns x, y, z of the three maps, one map after another. The last number is only padding for loads.
  double maps[28];
  double translation[3], shift[3];  // at the step, and the change to the next step
  double half_angle;                // of the whole turn
  float growth[9];                  // the factor of the inverse at the next step, minus 1: columns
  std::uint8_t is_ready;            // 0: rays are mapped by TurnStep, and the other fields here are undefined
  std::uint8_t grows;               // 0: `growth` is 0
  std::uint8_t is_mirrored;
};
static_assert(sizeof(TurnBack) == 320);

// Turn ray ------------------------------------------------------------------------------------------------------------
// Maps a ray to a turning instance (math/turning.h).
// Kernels include this file: nothing in it may have external linkage.

// Computes sine and cosine of an angle from 0 to half of pi, each as sine_of_quarter() does.
PERFECT_BVH_LANES void sine_and_cosine(double angle, double& sine, double& cosine) noexcept {
  constexpr double kQuarter = 1.5707963267948966;
  const Double2 x = {angle, kQuarter - angle};
  const Double2 square = x * x;
  Double2 sum = {kSineSeries[9], kSineSeries[9]};
  for (int i = 8; i >= 0; --i) sum = sum * square + Double2{kSineSeries[i], kSineSeries[i]};
  const Double2 both = x + x * (square * sum);
  sine = both[0], cosine = both[1];
}

// Returns v plus `growth` at `share`, applied to v. Of each four numbers loaded, the last is not part of the column.
PERFECT_BVH_LANES Double4 grown(const TurnBack& turn, double share, const Double4& v) noexcept {
  const char* const columns = reinterpret_cast<const char*>(&turn) + offsetof(TurnBack, growth);
  const Double4 x = load4_widened(columns), y = load4_widened(columns + 12), z = load4_widened(columns + 24);
  return v + all4(share) * ((x * all4(v[0]) + y * all4(v[1])) + z * all4(v[2]));
}

// Maps a ray, given in the world times `world_scale`, to the mesh's frame about `centre` times `tree_scale`, at a share
// of the interval. Loads of rays and centre also read the bytes after their three numbers.
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
