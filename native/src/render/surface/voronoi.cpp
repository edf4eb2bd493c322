#include "render/surface/voronoi.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/elementary.h"
#include "render/surface/texture_space.h"

namespace perfect_bvh {
namespace {

constexpr float kFar = std::numeric_limits<float>::max();

template <std::size_t N>
using Cell = std::array<std::int32_t, N>;

// The grid ------------------------------------------------------------------------------------------------------------

template <std::size_t N>
struct Grid {
  Grid(const Coordinates<N>& p, float randomness) noexcept
      : corner(each_axis<N>([&](std::size_t i) { return std::floor(p[i]); })),
        local(p - corner),
        cell(each_axis<N>(
            [&](std::size_t i) { return static_cast<std::int32_t>(clamped(corner[i], -0x1p30f, 0x1p30f)); })),
        random(randomness) {}

  [[nodiscard]] Cell<N> neighbour(const Cell<N>& step) const noexcept {
    return each_axis<N>([&](std::size_t i) { return cell[i] + step[i]; });
  }
  // The random point of a neighbouring cell, relative to this cell's corner.
  [[nodiscard]] Coordinates<N> point(const Cell<N>& step) const noexcept {
    const Coordinates<N> begin = each_axis<N>([&](std::size_t i) { return static_cast<float>(step[i]); });
    if constexpr (N == 1) return {begin[0] + random_of(corner[0] + begin[0]) * random};
    if constexpr (N > 1) return begin + random_of_cell(neighbour(step)) * random;
  }
  [[nodiscard]] Vec3f color(const Cell<N>& step) const noexcept {
    if constexpr (N == 1) return random_color(Coordinates<1>{corner[0] + static_cast<float>(step[0])});
    if constexpr (N > 1) {
      Cell<(N < 3 ? 3 : N)> wide{};
      std::ranges::copy(neighbour(step), wide.begin());
      const auto numbers = random_of_cell(wide);
      return {numbers[0], numbers[1], numbers[2]};
    }
  }

  Coordinates<N> corner, local;  // local: the point relative to the corner
  Cell<N> cell;
  float random;
};

// Calls body(step) for all cells up to `reach` away, x first.
template <std::size_t N, class Body>
void for_each_step(int reach, const Body& body) noexcept {
  Cell<N> step{};
  step.fill(-reach);
  for (;;) {
    body(step);
    std::size_t axis = 0;
    while (axis < N && step[axis] == reach) step[axis++] = -reach;
    if (axis == N) return;
    ++step[axis];
  }
}

// Distances -----------------------------------------------------------------------------------------------------------

// A cheaper function with the same order as distances.
template <std::size_t N>
float measure(const Coordinates<N>& offset, const VoronoiSettings& settings) noexcept {
  if constexpr (N == 1) return std::abs(offset[0]);
  float sum = 0.0f;
  switch (settings.metric) {
    case VoronoiMetric::kEuclidean:
      return inner(offset, offset);
    case VoronoiMetric::kManhattan:
      for (const float size : offset) sum += std::abs(size);
      return sum;
    case VoronoiMetric::kChebychev:
      for (const float size : offset) sum = std::max(sum, std::abs(size));
      return sum;
    case VoronoiMetric::kMinkowski:
      for (const float size : offset) sum += power(std::abs(size), settings.exponent);
      return sum;
  }
  return sum;
}

template <std::size_t N>
float distance_of(float measured, const VoronoiSettings& settings) noexcept {
  if (N > 1 && settings.metric == VoronoiMetric::kEuclidean) return std::sqrt(measured);
  if (N > 1 && settings.metric == VoronoiMetric::kMinkowski) return power(measured, 1.0f / settings.exponent);
  return measured;
}

// Features ------------------------------------------------------------------------------------------------------------

template <std::size_t N>
struct Octave {
  float distance = 0.0f;
  Vec3f color{0, 0, 0};
  Coordinates<N> position{};
};

// Finds the nearest point, or the second nearest.
template <std::size_t N>
Octave<N> nearest(const Coordinates<N>& p, const VoronoiSettings& settings, bool is_second) noexcept {
  struct Found {
    float measured = kFar;
    Cell<N> step{};
    Coordinates<N> point{};
  };
  const Grid<N> grid(p, settings.randomness);
  Found first, second;
  for_each_step<N>(1, [&](const Cell<N>& step) {
    const Coordinates<N> point = grid.point(step);
    const Found found{measure(point - grid.local, settings), step, point};
    if (found.measured < first.measured) {
      if (is_second) second = first;
      first = found;
    } else if (is_second && found.measured < second.measured) {
      second = found;
    }
  });
  const Found& found = is_second ? second : first;
  return {distance_of<N>(found.measured, settings), grid.color(found.step), found.point + grid.corner};
}

// Blends points whose distances differ by less than the smoothness.
template <std::size_t N>
Octave<N> smooth(const Coordinates<N>& p, const VoronoiSettings& settings) noexcept {
  const Grid<N> grid(p, settings.randomness);
  const float width = settings.smoothness;
  Octave<N> result;
  bool is_first = true;
  for_each_step<N>(2, [&](const Cell<N>& step) {
    const Coordinates<N> point = grid.point(step);
    const float distance = distance_of<N>(measure(point - grid.local, settings), settings);
    const float t = std::clamp(0.5f + 0.5f * (result.distance - distance) / width, 0.0f, 1.0f);
    const float share = is_first ? 1.0f : t * t * (3.0f - 2.0f * t);
    is_first = false;
    const float dip = width * share * (1.0f - share), small_dip = dip / (1.0f + 3.0f * width);
    result.distance = mix(result.distance, distance, share) - dip;
    result.color = mix(result.color, grid.color(step), share) - Vec3f{1, 1, 1} * small_dip;
    result.position = mix(result.position, point, share);
    for (float& x : result.position) x -= small_dip;
  });
  result.position = result.position + grid.corner;
  return result;
}

// Returns the distance to the half plane between the nearest point and another.
template <std::size_t N>
float distance_to_edge(const Coordinates<N>& p, const VoronoiSettings& settings) noexcept {
  constexpr float kSamePoint = N == 1 ? 0.0f : 1e-4f;
  const Grid<N> grid(p, settings.randomness);
  Coordinates<N> closest{};
  float least = kFar;
  for_each_step<N>(1, [&](const Cell<N>& step) {
    const Coordinates<N> offset = grid.point(step) - grid.local;
    if (const float square = inner(offset, offset); square < least) least = square, closest = offset;
  });
  float distance = kFar;
  for_each_step<N>(1, [&](const Cell<N>& step) {
    const Coordinates<N> offset = grid.point(step) - grid.local, across = offset - closest;
    const float square = inner(across, across);
    if (square > kSamePoint)
      distance = std::min(distance, inner((closest + offset) * 0.5f, across * (1.0f / std::sqrt(square))));
  });
  return distance;
}

// Returns half the distance between the nearest point and that point's nearest neighbour.
template <std::size_t N>
float n_sphere_radius(const Coordinates<N>& p, const VoronoiSettings& settings) noexcept {
  const Grid<N> grid(p, settings.randomness);
  Coordinates<N> closest{};
  Cell<N> closest_step{};
  float least = kFar;
  for_each_step<N>(1, [&](const Cell<N>& step) {
    const Coordinates<N> point = grid.point(step), offset = point - grid.local;
    if (const float square = inner(offset, offset); square < least)
      least = square, closest = point, closest_step = step;
  });
  least = kFar;
  for_each_step<N>(1, [&](const Cell<N>& step) {
    if (step == Cell<N>{}) return;
    const Coordinates<N> offset =
        grid.point(each_axis<N>([&](std::size_t i) { return closest_step[i] + step[i]; })) - closest;
    least = std::min(least, inner(offset, offset));
  });
  return 0.5f * std::sqrt(least);
}

// Octaves -------------------------------------------------------------------------------------------------------------

// Calls add(scale, amplitude, share) for each octave; the last one's share is the fraction of `detail`.
template <class Add>
void for_each_octave(const VoronoiSettings& settings, const Add& add) noexcept {
  float scale = 1.0f, amplitude = 1.0f;
  for (int i = 0; static_cast<float>(i) <= std::ceil(settings.detail); ++i) {
    const bool is_whole = static_cast<float>(i) <= settings.detail;
    add(scale, amplitude, is_whole ? 1.0f : settings.detail - std::floor(settings.detail));
    scale *= settings.lacunarity, amplitude *= settings.roughness;
  }
}

template <std::size_t N>
Octave<N> octave_of(const Coordinates<N>& p, const VoronoiSettings& settings) noexcept {
  if (settings.feature == VoronoiFeature::kSmoothF1 && settings.smoothness != 0.0f) return smooth(p, settings);
  return nearest(p, settings, settings.feature == VoronoiFeature::kF2);
}

template <std::size_t N>
Octave<N> fractal(const Coordinates<N>& p, const VoronoiSettings& settings, bool has_octaves) noexcept {
  Octave<N> sum;
  float range = 0.0f;
  if (!has_octaves) {
    sum = octave_of(p, settings), range = 1.0f;
  } else {
    for_each_octave(settings, [&](float scale, float amplitude, float share) {
      const Octave<N> octave = octave_of(p * scale, settings);
      range = mix(range, range + amplitude, share);
      sum.distance = mix(sum.distance, sum.distance + octave.distance * amplitude, share);
      sum.color = mix(sum.color, sum.color + octave.color * amplitude, share);
      sum.position = mix(sum.position, mix(sum.position, octave.position / scale, amplitude), share);
    });
  }
  if (!settings.normalize) return sum;
  Coordinates<N> farthest{};
  farthest.fill(0.5f + 0.5f * settings.randomness);
  const float farther = settings.feature == VoronoiFeature::kF2 ? 2.0f : 1.0f;
  sum.distance /= range * (distance_of<N>(measure(farthest, settings), settings) * farther);
  sum.color = sum.color * (1.0f / range);
  return sum;
}

template <std::size_t N>
float fractal_edges(const Coordinates<N>& p, const VoronoiSettings& settings, bool has_octaves) noexcept {
  const float farthest = 0.5f + 0.5f * settings.randomness;
  float distance = 8.0f, range = farthest;  // 8: larger than any distance to an edge
  if (!has_octaves) {
    distance = distance_to_edge(p, settings);
  } else {
    for_each_octave(settings, [&](float scale, float amplitude, float share) {
      const float nearer = std::min(distance, distance_to_edge(p * scale, settings) / scale);
      range = mix(range, mix(range, farthest / scale, amplitude), share);
      distance = mix(distance, std::min(mix(distance, nearer, amplitude), distance), share);
    });
  }
  return settings.normalize ? distance / range : distance;
}

VoronoiSettings valid(VoronoiSettings settings) noexcept {
  settings.detail = clamped(settings.detail, 0.0f, 15.0f);
  settings.roughness = clamped(settings.roughness, 0.0f, 1.0f);
  settings.randomness = clamped(settings.randomness, 0.0f, 1.0f);
  settings.smoothness = clamped(settings.smoothness / 2.0f, 0.0f, 0.5f);
  return settings;
}

template <std::size_t N>
VoronoiTexture texture(const VoronoiSettings& settings, const Coordinates<N>& p) noexcept {
  const bool has_octaves = settings.detail != 0.0f && settings.roughness != 0.0f;
  VoronoiTexture made;
  if (settings.feature == VoronoiFeature::kNSphereRadius) {
    made.radius = n_sphere_radius(p, settings);
    return made;
  }
  if (settings.feature == VoronoiFeature::kDistanceToEdge) {
    made.distance = fractal_edges(p, settings, has_octaves);
    return made;
  }
  const Octave<N> octave = fractal(p, settings, has_octaves);
  made.distance = octave.distance, made.color = octave.color;
  const Coordinates<N> position = settings.scale != 0.0f ? octave.position * (1.0f / settings.scale) : Coordinates<N>{};
  if constexpr (N != 1)
    for (std::size_t i = 0; i < std::min<std::size_t>(N, 3); ++i) made.position[static_cast<int>(i)] = position[i];
  if constexpr (N == 1 || N == 4) made.w = position[N - 1];
  return made;
}

}  // namespace

VoronoiTexture voronoi_texture(const VoronoiSettings& given, Vec3f p, float w) noexcept {
  const VoronoiSettings settings = valid(given);
  return with_dimensions(settings.dimensions,
                         [&]<class N>(N) { return texture(settings, coordinates_of<N::value>(p, w, settings.scale)); });
}

}  // namespace perfect_bvh
