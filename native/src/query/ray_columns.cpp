#include "query/ray_columns.h"

#include <cmath>
#include <limits>

namespace perfect_bvh {
namespace {

// Origins or directions: numbers with a stride.
template <class T>
struct Vectors {
  const T* numbers;
  std::ptrdiff_t stride;

  Vectors(const Vec3<T>* first, std::ptrdiff_t the_stride) noexcept
      : numbers(reinterpret_cast<const T*>(first)), stride(the_stride) {}
  [[nodiscard]] Vec3d operator[](std::size_t row) const noexcept {
    const T* const at = numbers + static_cast<std::ptrdiff_t>(row) * stride;
    return {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
  }
};

// As is_valid says, in half of its steps: x - x is zero unless x is not finite.
inline bool can_hit(Vec3d o, Vec3d d, float t_min, float t_max) noexcept {
  const Vec3d zeros = (o - o) + (d - d);
  const double length = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  return (zeros.x + zeros.y + zeros.z == 0.0) & (length > 0.0) & (t_min <= t_max);
}

template <class Origin, class Direction>
std::size_t load(const RayColumns& columns, Vectors<Origin> origins, Vectors<Direction> directions, std::size_t first,
                 std::span<Ray> rays) noexcept {
  std::size_t valid = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const std::size_t row = first + i;
    const Vec3d origin = origins[row], direction = directions[row];
    const float t_min = columns.t_min[row * columns.t_min_stride], time = columns.times[row * columns.time_stride];
    // No ray of no time hits anything: its range is none.
    constexpr float kNoRange = std::numeric_limits<float>::quiet_NaN();
    const float t_max = is_in_shutter(time) ? columns.t_max[row * columns.t_max_stride] : kNoRange;
    valid += static_cast<std::size_t>(can_hit(origin, direction, t_min, t_max));
    rays[i].origin = origin;
    rays[i].direction = direction;
    rays[i].t_min = t_min;
    rays[i].t_max = t_max;
    rays[i].mask = columns.masks[row * columns.mask_stride];
    rays[i].time = time;
  }
  return rays.size() - valid;
}

template <class Origin>
std::size_t load_from(const RayColumns& columns, const Vec3<Origin>* origins, std::size_t first,
                      std::span<Ray> rays) noexcept {
  const Vectors<Origin> starts(origins, columns.origin_stride);
  if (columns.directions_double) {
    return load(columns, starts, Vectors<double>(columns.directions_double, columns.direction_stride), first, rays);
  }
  return load(columns, starts, Vectors<float>(columns.directions_float, columns.direction_stride), first, rays);
}

}  // namespace

std::size_t load_rays(const RayColumns& columns, std::size_t first, std::span<Ray> rays) noexcept {
  if (columns.origins_double) {
    return load_from(columns, columns.origins_double, first, rays);
  }
  return load_from(columns, columns.origins_float, first, rays);
}

}  // namespace perfect_bvh
