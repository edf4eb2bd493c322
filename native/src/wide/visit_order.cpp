#include "wide/visit_order.h"

#include <array>

#include "math/float4.h"

namespace perfect_bvh {
namespace {

// The octants of the four lanes: rays that run up all axes, and down one of them. 7 minus each is the opposite one.
constexpr std::array<std::uint32_t, 4> kOctants{0, 1, 2, 4};

}  // namespace

void set_visit_order(WideNode& node, std::uint32_t count) noexcept {
  std::array<Float4, kWideWidth> distance;  // lane: octant
  for (std::uint32_t child = 0; child < count; ++child) {
    const auto centre = [&](int axis) {
      return node.planes[2 * axis][child] * 0.5f + node.planes[2 * axis + 1][child] * 0.5f;
    };
    const float x = centre(0), y = centre(1), z = centre(2);
    distance[child] = Float4(x, -x, x, x) + Float4(y, y, -y, y) + Float4(z, z, z, -z);
  }
  std::array<Int4, kWideWidth> rank;  // minus how many come first; of two equal ones the first does
  for (std::uint32_t child = 0; child < count; ++child) {
    rank[child] = Int4(0);
    for (std::uint32_t before = 0; before < child; ++before) {
      const Int4 is_farther = less(distance[before], distance[child]);
      rank[before] = rank[before] + is_farther;
      rank[child] = rank[child] - Int4(1) - is_farther;
    }
  }
  for (std::uint32_t place = 0; place < kWideWidth; ++place) {
    node.order[place] = place < count ? 0 : place * 0b001'001'001'001'001'001'001'001;  // unused places keep their own
  }
  for (std::uint32_t child = 0; child < count; ++child) {
    alignas(16) std::array<std::int32_t, 4> places;
    rank[child].store(places.data());
    for (std::size_t i = 0; i < 4; ++i) {
      const auto place = static_cast<std::uint32_t>(-places[i]);
      node.order[place] |= child << (3 * kOctants[i]);
      node.order[count - 1 - place] |= child << (3 * (7 - kOctants[i]));
    }
  }
}

}  // namespace perfect_bvh
