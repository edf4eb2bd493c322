#include "render/surface/noise.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/surface/texture_space.h"

namespace perfect_bvh {
namespace {

// Perlin noise --------------------------------------------------------------------------------------------------------

constexpr float kPeriod = 1e5f;  // beyond which a float's fraction is too coarse

// Returns the number, or its negative if the hash has this bit. This and slopes avoid branches, which could not be
// predicted.
constexpr float signed_by(float value, std::uint32_t hash, int bit) noexcept {
  return std::bit_cast<float>(std::bit_cast<std::uint32_t>(value) ^ (hash >> bit) << 31);
}

// Multiplies the offset from a corner by the corner's gradient, which the low bits of its hash choose: in two
// dimensions (1, 2) or (2, 1), in three and four the middle of an edge, all with any signs.
float slope(std::uint32_t hash, const Coordinates<2>& offset) noexcept {
  const std::size_t first = hash >> 2 & 1u;
  return signed_by(offset[first], hash, 0) + signed_by(2.0f * offset[1 - first], hash, 1);
}
float slope(std::uint32_t hash, const Coordinates<3>& offset) noexcept {
  // There are 16 numbers for 12 edges: the last four repeat (y, x) and (y, z).
  constexpr std::array<std::uint8_t, 16> kFirst{0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};
  constexpr std::array<std::uint8_t, 16> kSecond{1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 0, 2, 0, 2};
  const std::size_t edge = hash & 15u;
  return signed_by(offset[kFirst[edge]], hash, 0) + signed_by(offset[kSecond[edge]], hash, 1);
}
float slope(std::uint32_t hash, const Coordinates<4>& offset) noexcept {
  const std::size_t left_out = 3u - (hash >> 3 & 3u);
  const auto at = [&](std::size_t axis) { return offset[axis + (axis >= left_out ? 1u : 0u)]; };
  return signed_by(at(0), hash, 0) + signed_by(at(1), hash, 1) + signed_by(at(2), hash, 2);
}

// Returns the integers below a point, and its distance above them.
template <std::size_t N>
struct Lattice {
  explicit Lattice(const Coordinates<N>& p) noexcept {
    for (std::size_t i = 0; i < N; ++i) {
      // Where all floats are integers, uses half a cell: noise is 0 there.
      float inside = std::abs(p[i]) < kPeriod ? p[i] : std::fmod(p[i], kPeriod);
      if (std::abs(p[i]) >= 1e6f) inside += 0.5f;
      const float below = std::floor(inside);
      cell[i] = static_cast<std::int32_t>(below), fraction[i] = inside - below;
    }
  }
  std::array<std::int32_t, N> cell;
  Coordinates<N> fraction;
};

template <std::size_t N>
bool is_finite(const Coordinates<N>& p) noexcept {
  return std::ranges::all_of(p, [](float x) { return std::isfinite(x); });
}

// 6 t^5 - 15 t^4 + 10 t^3, divided by t^2 or t^3.
float fade_factor(float t) noexcept { return multiply_add(t, multiply_add(t, 6.0f, -15.0f), 10.0f); }

// Gradient noise from -1 to 1, 0 at integers; periodic. Rounded as in Cycles' kernels: a distorted texture is evaluated
// at points moved by it, and far out a last bit may change its value by a tenth.
float perlin(const Coordinates<1>& p) noexcept {
  if (!is_finite(p)) return 0.0f;
  const Lattice<1> lattice(p);
  const float t = lattice.fraction[0], fade = t * t * t * fade_factor(t);
  const auto gradient = [&](std::int32_t step) {  // 1 to 8, with either sign
    const std::uint32_t hash = lookup3(Words<1>{static_cast<std::uint32_t>(lattice.cell[0] + step)});
    return signed_by(1.0f + static_cast<float>(hash & 7u), hash, 3);
  };
  const float left = gradient(0), right = gradient(1) * (t - 1.0f);
  return 0.25f * multiply_add(left, t, fade * multiply_add(-left, t, right));
}
template <std::size_t N>
float perlin(const Coordinates<N>& p) noexcept {
  constexpr std::array<float, 3> kRange{0.6616f, 0.9820f, 0.8344f};  // about 1 / the largest value
  if (!is_finite(p)) return 0.0f;
  const Lattice<N> lattice(p);
  // Corners are interpolated along w first, then x, y, z. Bit k of a corner's number is its step along axis_of(k).
  const auto axis_of = [](std::size_t k) { return N == 4 ? (k + 3) % 4 : k; };
  std::array<float, std::size_t{1} << N> corners{};
  for (std::size_t corner = 0; corner < corners.size(); ++corner) {
    Words<N> words{};
    Coordinates<N> offset{};
    for (std::size_t k = 0; k < N; ++k) {
      const std::size_t axis = axis_of(k);
      const auto step = static_cast<std::int32_t>(corner >> k & 1u);
      words[axis] = static_cast<std::uint32_t>(lattice.cell[axis] + step);
      offset[axis] = lattice.fraction[axis] - static_cast<float>(step);
    }
    corners[corner] = slope(lookup3(words), offset);
  }
  for (std::size_t k = 0; k < N; ++k) {
    const float t = lattice.fraction[axis_of(k)], fade = (t * t) * (t * fade_factor(t));
    for (std::size_t pair = 0; pair < corners.size() >> (k + 1); ++pair)
      corners[pair] = multiply_add(fade, corners[2 * pair + 1] - corners[2 * pair], corners[2 * pair]);
  }
  return corners[0] * kRange[N - 2];
}

// Fractals ------------------------------------------------------------------------------------------------------------
// An octave is noise of a finer scale. The last one is weighted by the fraction of `detail`.

struct Octaves {
  explicit Octaves(float detail) noexcept : whole(static_cast<int>(detail)), rest(detail - std::floor(detail)) {}
  int whole;
  float rest;
};

template <std::size_t N>
float fbm(const Coordinates<N>& p, const NoiseSettings& settings, Octaves octaves) noexcept {
  float scale = 1.0f, amplitude = 1.0f, range = 0.0f, sum = 0.0f;
  const auto result = [&] { return settings.normalize ? 0.5f * sum / range + 0.5f : sum; };
  const auto add = [&] {
    sum += perlin(p * scale) * amplitude, range += amplitude;
    amplitude *= settings.roughness, scale *= settings.lacunarity;
  };
  for (int i = 0; i <= octaves.whole; ++i) add();
  if (octaves.rest == 0.0f) return result();
  const float coarse = result();
  add();
  return mix(coarse, result(), octaves.rest);
}

template <std::size_t N>
float multifractal(Coordinates<N> p, const NoiseSettings& settings, Octaves octaves) noexcept {
  float value = 1.0f, amplitude = 1.0f;
  for (int i = 0; i <= octaves.whole; ++i) {
    value *= amplitude * perlin(p) + 1.0f;
    amplitude *= settings.roughness, p = p * settings.lacunarity;
  }
  return octaves.rest != 0.0f ? value * (octaves.rest * amplitude * perlin(p) + 1.0f) : value;
}

// The higher a point, the larger the weight of its finer octaves.
template <std::size_t N>
float hetero_terrain(Coordinates<N> p, const NoiseSettings& settings, Octaves octaves) noexcept {
  float value = settings.offset + perlin(p), amplitude = settings.roughness;
  const auto rise = [&] {
    p = p * settings.lacunarity;
    const float height = (perlin(p) + settings.offset) * amplitude * value;
    amplitude *= settings.roughness;
    return height;
  };
  for (int i = 1; i <= octaves.whole; ++i) value += rise();
  return octaves.rest != 0.0f ? value + octaves.rest * rise() : value;
}

template <std::size_t N>
float hybrid_multifractal(Coordinates<N> p, const NoiseSettings& settings, Octaves octaves) noexcept {
  constexpr float kLeastWeight = 0.001f;
  float value = 0.0f, weight = 1.0f, amplitude = 1.0f;
  for (int i = 0; i <= octaves.whole + 1 && weight > kLeastWeight; ++i) {
    const float share = i <= octaves.whole ? 1.0f : octaves.rest;
    if (share == 0.0f) break;
    weight = std::min(weight, 1.0f);
    const float signal = (perlin(p) + settings.offset) * amplitude;
    value += share * weight * signal;
    weight *= settings.gain * signal, amplitude *= settings.roughness, p = p * settings.lacunarity;
  }
  return value;
}

// Does not use a fractional octave.
template <std::size_t N>
float ridged_multifractal(Coordinates<N> p, const NoiseSettings& settings, Octaves octaves) noexcept {
  const auto ridge = [&] {
    const float height = settings.offset - std::abs(perlin(p));
    return height * height;
  };
  float signal = ridge(), value = signal, amplitude = settings.roughness;
  for (int i = 1; i <= octaves.whole; ++i) {
    p = p * settings.lacunarity;
    signal = std::clamp(signal * settings.gain, 0.0f, 1.0f) * ridge();
    value += signal * amplitude, amplitude *= settings.roughness;
  }
  return value;
}

template <std::size_t N>
float fractal(const Coordinates<N>& p, const NoiseSettings& settings) noexcept {
  const Octaves octaves(settings.detail);
  switch (settings.kind) {
    case NoiseKind::kMultifractal:
      return multifractal(p, settings, octaves);
    case NoiseKind::kRidgedMultifractal:
      return ridged_multifractal(p, settings, octaves);
    case NoiseKind::kHybridMultifractal:
      return hybrid_multifractal(p, settings, octaves);
    case NoiseKind::kFbm:
      return fbm(p, settings, octaves);
    case NoiseKind::kHeteroTerrain:
      return hetero_terrain(p, settings, octaves);
  }
  return 0.0f;
}

// The node ------------------------------------------------------------------------------------------------------------

// Moves a point to another part of the noise, 100 to 200 away, where values are unrelated.
template <std::size_t N>
Coordinates<N> elsewhere(const Coordinates<N>& p, float seed) noexcept {
  return each_axis<N>([&](std::size_t i) {
    const float random = N == 1 ? random_of(seed) : random_of(seed, static_cast<float>(i));
    return p[i] + (100.0f + random * 100.0f);
  });
}

// Rounds as Cycles does, which adds the first of one or two products unrounded.
template <std::size_t N>
Coordinates<N> distorted(const Coordinates<N>& p, float distortion) noexcept {
  if (distortion == 0.0f) return p;
  return each_axis<N>([&](std::size_t i) {
    const float shift = perlin(elsewhere(p, static_cast<float>(i)));
    return N <= 2 && i == 0 ? multiply_add(shift, distortion, p[i]) : p[i] + shift * distortion;
  });
}

NoiseSettings valid(NoiseSettings settings) noexcept {
  settings.detail = clamped(settings.detail, 0.0f, 15.0f);
  settings.roughness = std::max(settings.roughness, 0.0f);
  return settings;
}

}  // namespace

float noise_factor(const NoiseSettings& given, Vec3f p, float w) noexcept {
  const NoiseSettings settings = valid(given);
  return with_dimensions(settings.dimensions, [&]<class N>(N) {
    return fractal(distorted(coordinates_of<N::value>(p, w, settings.scale), settings.distortion), settings);
  });
}

Vec3f noise_color(const NoiseSettings& given, Vec3f p, float w) noexcept {
  const NoiseSettings settings = valid(given);
  return with_dimensions(settings.dimensions, [&]<class N>(N) {
    // The first seeds are those of the distortion.
    constexpr float kSeed = static_cast<float>(N::value);
    const auto point = distorted(coordinates_of<N::value>(p, w, settings.scale), settings.distortion);
    return Vec3f{fractal(point, settings), fractal(elsewhere(point, kSeed), settings),
                 fractal(elsewhere(point, kSeed + 1.0f), settings)};
  });
}

}  // namespace perfect_bvh
