// A colour with alpha, four floats: a row of the caller's arrays.
#pragma once

namespace perfect_bvh {

struct Rgba {
  float r = 0.0f, g = 0.0f, b = 0.0f, a = 0.0f;
};
static_assert(sizeof(Rgba) == 16);

}  // namespace perfect_bvh
