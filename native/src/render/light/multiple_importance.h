// Directions that are sampled in two ways: towards lights (next-event estimation), and by the surface (BSDF sampling).
// Each way counts as much as it is likely to choose the direction (balance heuristic, Veach and Guibas 1995), so that
// the sum is right and neither way is far off: small lights are found by the first, what is large or near by the
// second.
#pragma once

namespace perfect_bvh {

// The share of a way that chooses a direction with this density, beside one of the other density. Densities are those
// of solid angle; this one may be infinite, as of a point of light: then it is the only way.
[[nodiscard]] constexpr float balance(float density, float other) noexcept {
  return density > 0.0f ? 1.0f / (1.0f + other / density) : 0.0f;
}

}  // namespace perfect_bvh
