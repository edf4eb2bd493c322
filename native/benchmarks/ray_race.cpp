#include "ray_race.h"

#include <algorithm>
#include <numeric>
#include <random>

namespace perfect_bvh::bench {
namespace {

constexpr std::size_t kChunk = 8192;

double lower_third(std::vector<double> times) {
  const auto place = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 3);
  std::nth_element(times.begin(), place, times.end());
  return *place;
}

// Of one competitor: by chunk, then by round.
using Times = std::vector<std::vector<double>>;

RaceResult result_of(const Times& times, std::size_t ray_count) {
  const double mrays = 1e-6 * static_cast<double>(ray_count);
  double best = 0;
  std::vector<double> round_seconds(times.front().size(), 0.0), rates;
  for (const std::vector<double>& chunk : times) {
    best += lower_third(chunk);
    for (std::size_t round = 0; round < chunk.size(); ++round) round_seconds[round] += chunk[round];
  }
  for (const double each : round_seconds) rates.push_back(mrays / each);
  return {mrays / best, Spread::of(rates)};
}

}  // namespace

std::vector<RaceResult> race(const RaySet& set, std::span<const RayCompetitor> competitors, int rounds) {
  if (set.rays.empty() || rounds < 1) return std::vector<RaceResult>(competitors.size());
  const std::size_t chunk_count = (set.rays.size() + kChunk - 1) / kChunk;
  std::vector<Hit> hits(kChunk);
  std::vector<std::uint8_t> occluded(kChunk);
  std::vector<std::size_t> order(competitors.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937 random(1);
  std::vector<Times> times(competitors.size(), Times(chunk_count));
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t chunk = 0; chunk < chunk_count; ++chunk) {
      const std::size_t begin = chunk * kChunk;
      const std::span rays = std::span(set.rays).subspan(begin, std::min(kChunk, set.rays.size() - begin));
      std::shuffle(order.begin(), order.end(), random);
      for (const std::size_t who : order) {
        const double start = seconds(1);
        if (set.is_any_hit)
          competitors[who].any(rays, occluded.data());
        else
          competitors[who].closest(rays, hits.data());
        times[who][chunk].push_back(seconds(1) - start);
      }
    }
  }
  std::vector<RaceResult> results;
  for (const Times& each : times) results.push_back(result_of(each, set.rays.size()));
  return results;
}

}  // namespace perfect_bvh::bench
