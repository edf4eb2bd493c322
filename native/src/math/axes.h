// A loop over the three axes whose numbers are constants.
#pragma once

#include <type_traits>

namespace perfect_bvh {

// Calls body(axis) with the constants 0, 1 and 2: so that components of vectors are found without a branch.
template <class Body>
constexpr void for_each_axis(const Body& body) {
  body(std::integral_constant<int, 0>{});
  body(std::integral_constant<int, 1>{});
  body(std::integral_constant<int, 2>{});
}

}  // namespace perfect_bvh
