// Decides exactly on which side of a triangle's edges a ray passes (Shewchuk 1997, "Adaptive Precision Floating-Point
// Arithmetic and Fast Robust Geometric Predicates"). Used for the few rays that double precision cannot decide.
//
// With corners p0, p1, p2 seen from the ray's origin o and its direction d, the weights of the corners are
//   w0 = d . (p2 x p1)    w1 = d . (p0 x p2)    w2 = d . (p1 x p0)
// The ray's line hits the closed triangle if all weights are >= 0, or all are <= 0, and they are not all zero. If all
// are zero, the line lies in the plane, or the triangle has no area. Each product is split into doubles that sum to it,
// and these are added to an expansion, whose largest term has the sign of the sum.
//
// Exact for numbers whose products of three neither overflow a double nor have parts below its smallest number: all
// floats, and doubles from 1e-90 to 1e90.
#pragma once

namespace perfect_bvh {

struct ExactWeights {
  double w[3];  // each has the right sign, and is within three units in the last place
  bool is_hit;
};

[[nodiscard]] ExactWeights exact_weights(const double origin[3], const double direction[3],
                                         const float* const corners[3]) noexcept;

// Returns (p0, p1, p2) . : the volume from which the plane's distance from `origin` follows, rounded once or twice.
[[nodiscard]] double exact_volume(const double origin[3], const float* const corners[3]) noexcept;

// Moves the origin to origin + t * direction. Each component is rounded once or twice, for any sizes of the two terms
// and their sum.
void move_exactly(double origin[3], double t, const double direction[3]) noexcept;

}  // namespace perfect_bvh
