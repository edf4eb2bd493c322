#include "math/exact_edges.h"

#include <initializer_list>

namespace perfect_bvh {
namespace {

// A sum of two doubles that do not overlap.
struct Pair {
  double high, low;
};

// Knuth's sum: high + low == a + b.
Pair two_sum(double a, double b) noexcept {
  const double high = a + b, of_b = high - a, of_a = high - of_b;
  return {high, (a - of_a) + (b - of_b)};
}

// Dekker's product: high + low == a * b. Does not use a fused operation, which some C libraries round twice.
Pair two_product(double a, double b) noexcept {
  constexpr double kSplitter = 0x1p27 + 1.0;
  const auto split = [](double x) {
    const double scaled = kSplitter * x, high = scaled - (scaled - x);
    return Pair{high, x - high};
  };
  const double product = a * b;
  const Pair x = split(a), y = split(b);
  const double error = ((product - x.high * y.high) - x.low * y.high) - x.high * y.low;
  return {product, x.low * y.low - error};
}

// An exact sum, as doubles of increasing size that do not overlap.
class Expansion {
 public:
  void add(double term) noexcept {
    int kept = 0;
    for (int i = 0; i < count_; ++i) {
      const Pair sum = two_sum(term, terms_[i]);
      if (sum.low != 0.0) terms_[kept++] = sum.low;
      term = sum.high;
    }
    if (term != 0.0) terms_[kept++] = term;
    count_ = kept;
  }

  void add_product(double a, double b, double c) noexcept {
    if (a == 0.0 || b == 0.0 || c == 0.0) return;
    const Pair ab = two_product(a, b), high = two_product(ab.high, c), low = two_product(ab.low, c);
    for (const double term : {low.low, low.high, high.low, high.high}) add(term);
  }

  // Returns the rounded sum, whose sign is that of the largest term.
  [[nodiscard]] double value() const noexcept {
    double sum = 0.0;
    for (int i = 0; i < count_; ++i) sum += terms_[i];
    return sum;
  }

 private:
  double terms_[200];  // six products of three pairs have 192 terms
  int count_ = 0;
};

struct Row {
  Pair at[3];
};

Row seen_from(const double origin[3], const float corner[3]) noexcept {
  Row row;
  for (int axis = 0; axis < 3; ++axis) row.at[axis] = two_sum(static_cast<double>(corner[axis]), -origin[axis]);
  return row;
}

// Adds a * b * c of pairs, times a sign.
void add_pairs(Expansion& sum, double sign, const Pair& a, const Pair& b, const Pair& c) noexcept {
  for (const double x : {a.low, a.high}) {
    for (const double y : {b.low, b.high}) {
      for (const double z : {c.low, c.high}) sum.add_product(sign * x, y, z);
    }
  }
}

// a . (b x c)
double triple_product(const Row& a, const Row& b, const Row& c) noexcept {
  Expansion sum;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    add_pairs(sum, 1.0, a.at[i], b.at[j], c.at[k]);
    add_pairs(sum, -1.0, a.at[i], b.at[k], c.at[j]);
  }
  return sum.value();
}

}  // namespace

ExactWeights exact_weights(const double origin[3], const double direction[3], const float* const corners[3]) noexcept {
  const Row p[3] = {seen_from(origin, corners[0]), seen_from(origin, corners[1]), seen_from(origin, corners[2])};
  const Row d{{{direction[0], 0.0}, {direction[1], 0.0}, {direction[2], 0.0}}};
  ExactWeights weights{};
  bool any_positive = false, any_negative = false;
  for (int i = 0; i < 3; ++i) {
    weights.w[i] = triple_product(d, p[(i + 2) % 3], p[(i + 1) % 3]);
    any_positive = any_positive || weights.w[i] > 0.0;
    any_negative = any_negative || weights.w[i] < 0.0;
  }
  weights.is_hit = any_positive != any_negative;
  return weights;
}

double exact_volume(const double origin[3], const float* const corners[3]) noexcept {
  return triple_product(seen_from(origin, corners[0]), seen_from(origin, corners[1]), seen_from(origin, corners[2]));
}

void move_exactly(double origin[3], double t, const double direction[3]) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    const Pair way = two_product(t, direction[axis]), sum = two_sum(origin[axis], way.high);
    origin[axis] = sum.high + (sum.low + way.low);
  }
}

}  // namespace perfect_bvh
