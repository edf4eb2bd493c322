// Sorting eight values without branches: a network of 19 comparisons (Knuth, TAOCP 3, 5.3.4).
// In: values, and a function that orders two of them (lane by lane for vectors). Out: the values in ascending order.
#pragma once

#include <array>

namespace perfect_bvh {

// `order(a, b)` puts the smaller into a.
template <class Value, class Order>
void sort_eight(std::array<Value, 8>& v, const Order& order) noexcept {
  order(v[0], v[1]), order(v[2], v[3]), order(v[4], v[5]), order(v[6], v[7]);
  order(v[0], v[2]), order(v[1], v[3]), order(v[4], v[6]), order(v[5], v[7]);
  order(v[1], v[2]), order(v[5], v[6]), order(v[0], v[4]), order(v[3], v[7]);
  order(v[1], v[5]), order(v[2], v[6]);
  order(v[1], v[4]), order(v[3], v[6]);
  order(v[2], v[4]), order(v[3], v[5]);
  order(v[3], v[4]);
}

}  // namespace perfect_bvh
