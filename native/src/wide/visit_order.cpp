#include "wide/visit_order.h"

#include <array>
#include <limits>

#include "math/float4.h"
#include "math/short8.h"

namespace perfect_bvh {
namespace {

using Octants = std::array<Float4, kWideWidth>;  // by child; lanes: the octants below
// Rays that run up all axes, and down one of them. 7 minus each is the opposite one.
constexpr std::array<std::uint32_t, 4> kOctants{0, 1, 2, 4};

// One number for each place, in bytes from the lowest on: who stands there.
using Places = std::uint64_t;
constexpr Places kEveryoneAtHome = 0x0706050403020100u;

struct PlaceTable {
  std::array<std::array<Places, kWideWidth>, kWideWidth> child_at{};  // a child at a place
};
constexpr PlaceTable kTable = [] {
  PlaceTable table;
  for (std::uint32_t child = 0; child < kWideWidth; ++child) {
    for (std::uint32_t place = 0; place < kWideWidth; ++place) {
      table.child_at[child][place] = Places{child} << (8 * place);
    }
  }
  return table;
}();

// How far along the octants' diagonals the boxes stand; -infinity in places that are not taken.
Octants distances(const WideNode& node, std::uint32_t count) noexcept {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  static constexpr std::array<float, 2 * kWideWidth> kLimits{kFar,  kFar,  kFar,  kFar,  kFar,  kFar,  kFar,  kFar,
                                                             -kFar, -kFar, -kFar, -kFar, -kFar, -kFar, -kFar, -kFar};
  Octants distance;
  for (std::uint32_t first = 0; first < kWideWidth; first += 4) {
    const auto centre = [&](int axis) {
      return Float4::load(&node.planes[2 * axis][first]) * Float4(0.5f) +
             Float4::load(&node.planes[2 * axis + 1][first]) * Float4(0.5f);
    };
    const Float4 x = centre(0), y = centre(1), z = centre(2);
    const Float4 limit = Float4::load_unaligned(&kLimits[kWideWidth - count + first]);  // the minimum of NaN, too
    Float4 rows[4] = {min((x + y) + z, limit), min((y - x) + z, limit), min((x - y) + z, limit),
                      min((x + y) - z, limit)};
    transpose(rows[0], rows[1], rows[2], rows[3]);
    for (std::uint32_t i = 0; i < 4; ++i) distance[first + i] = rows[i];
  }
  return distance;
}

// How many come first; of two equal ones the first does.
struct Ranks {
  alignas(16) std::array<std::array<std::uint32_t, 4>, kWideWidth> of;  // by child, then octant
};

Ranks rank(const Octants& distance) noexcept {
  std::array<Int4, kWideWidth> places;
  for (std::uint32_t child = 0; child < kWideWidth; ++child) {
    Int4 place(static_cast<std::int32_t>(child));
    for (std::uint32_t before = 0; before < child; ++before) {
      const Int4 is_farther = less(distance[before], distance[child]);
      places[before] = places[before] - is_farther;
      place = place + is_farther;
    }
    places[child] = place;
  }
  Ranks ranks;
  for (std::uint32_t child = 0; child < kWideWidth; ++child) places[child].store(ranks.of[child].data());
  return ranks;
}

// The first `count` places from the last to the first; the others as they are.
Places reversed(Places places, std::uint32_t count) noexcept {
  if (count == 0) return kEveryoneAtHome;
  const std::uint32_t spare = 8 * (kWideWidth - count);
  const Places idle = count < kWideWidth ? kEveryoneAtHome >> (8 * count) << (8 * count) : 0;
  return __builtin_bswap64(places) >> spare | idle;
}

}  // namespace

void set_visit_order(WideNode& node, std::uint32_t count) noexcept {
  const Ranks ranks = rank(distances(node, count));
  std::array<Places, 8> order;  // by octant
  for (std::size_t i = 0; i < kOctants.size(); ++i) {
    Places places = 0;
    for (std::uint32_t child = 0; child < kWideWidth; ++child) places |= kTable.child_at[child][ranks.of[child][i]];
    order[kOctants[i]] = places;
    order[7 - kOctants[i]] = reversed(places, count);
  }
  const auto four = [&](std::size_t octant) {
    return (bytes_to_lanes(order[octant]) | bytes_to_lanes(order[octant + 1]) << 3) |
           (bytes_to_lanes(order[octant + 2]) << 6 | bytes_to_lanes(order[octant + 3]) << 9);
  };
  const Short8 first = four(0), second = four(4);
  (lower_lanes(first) | lower_lanes(second) << 12).store(&node.order[0]);
  (upper_lanes(first) | upper_lanes(second) << 12).store(&node.order[4]);
}

}  // namespace perfect_bvh
