// Where an instance stands while it moves: a transform between two of its steps (lecture, "Rigid motion").
//
// Each step's matrix is taken apart into a rotation and what is left of it, a stretch (Shoemake and Duff 1992, "Matrix
// animation and polar decomposition"). Between steps the rotation turns evenly by the shorter way (Shoemake 1985,
// "Animating rotation with quaternion curves"), stretch and translation go in straight lines: so do Blender's and
// Cycles' motion blur, and a wheel stays round, which it does not where matrices are interpolated. A turn by more than
// half of one between two steps is taken for the rest of it the other way round: it needs more steps.
//
// Doubles, and fixed operations: the same bits on every instruction set. Kernels include this file: nothing in it may
// have external linkage.
#pragma once

#include "math/step_times.h"

namespace perfect_bvh {

// One step.
struct TurnStep {
  double rotation[4];  // a quaternion, the real part first; not further from the one before than from its opposite
  double stretch[9];   // columns
  double translation[3];
  // To the next step, between the quaternions: half as far as the rotation turns.
  double angle, over_sine;  // 1 / its sine, or 0 where it is so small that a straight line is as good
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

// Of angles from 0 to half of pi: to a unit in the last place.
static inline double sine_of_quarter(double angle) noexcept {
  const double square = angle * angle;
  double sum = kSineSeries[9];
  for (int i = 8; i >= 0; --i) sum = sum * square + kSineSeries[i];
  return angle + angle * (square * sum);
}

// rotation * stretch, where the quaternion may have any length but 0.
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

// At a moment; `steps` are all of an instance's.
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

}  // namespace perfect_bvh
