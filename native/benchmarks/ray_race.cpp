#include "ray_race.h"

#include <algorithm>
#include <numeric>
#include <random>

namespace perfect_bvh::bench {
namespace {

double lower_third(std::vector<double> times) {
  const auto place = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 3);
  std::nth_element(times.begin(), place, times.end());
  return *place;
}

// Times of one competitor: by batch, then by round.
using Times = std::vector<std::vector<double>>;

RaceResult result_of(const Times& times, std::size_t ray_count, const Agreement& agreement) {
  const double mrays = 1e-6 * static_cast<double>(ray_count);
  double best = 0;
  std::vector<double> round_seconds(times.front().size(), 0.0), rates;
  for (const std::vector<double>& batch : times) {
    best += lower_third(batch);
    for (std::size_t round = 0; round < batch.size(); ++round) round_seconds[round] += batch[round];
  }
  for (const double each : round_seconds) rates.push_back(mrays / each);
  return {mrays / best, Spread::of(rates), agreement};
}

// Casts one batch; the first competitor's answers are the reference.
class Batch {
 public:
  Batch(std::span<const Ray> rays, RayUse use, RayCaster& first) : rays_(rays), use_(use) {
    if (use.is_any_hit) {
      occluded_.resize(rays.size());
      first.answer(rays, use, std::span(occluded_));
    } else {
      hits_.resize(rays.size());
      first.answer(rays, use, std::span(hits_));
    }
  }

  [[nodiscard]] Agreement compare_last_cast(const RayCaster& caster, double diagonal) const {
    if (use_.is_any_hit) {
      std::vector<std::uint8_t> occluded(rays_.size());
      caster.read(std::span(occluded));
      return compare(occluded, occluded_);
    }
    std::vector<Hit> hits(rays_.size());
    caster.read(std::span(hits));
    return compare(hits, hits_, diagonal);
  }

 private:
  const std::span<const Ray> rays_;
  const RayUse use_;
  std::vector<Hit> hits_;
  std::vector<std::uint8_t> occluded_;
};

double time_cast(RayCaster& caster, std::span<const Ray> rays, RayUse use) {
  caster.load(rays, use);
  const double start = seconds(1);
  caster.cast();
  return seconds(1) - start;
}

}  // namespace

std::vector<RaceResult> race(const RaySet& set, std::span<const RayCompetitor> competitors,
                             const RaceOptions& options) {
  if (set.rays.empty() || options.rounds < 1) return std::vector<RaceResult>(competitors.size());
  const std::size_t batch_count = (set.rays.size() + options.batch - 1) / options.batch;
  std::vector<std::size_t> order(competitors.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937 random(1);
  std::vector<Times> times(competitors.size(), Times(batch_count));
  std::vector<Agreement> agreements(competitors.size());
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t batch = 0; batch < batch_count; ++batch) {
      const std::size_t begin = batch * options.batch;
      const std::span rays = std::span(set.rays).subspan(begin, std::min(options.batch, set.rays.size() - begin));
      std::shuffle(order.begin(), order.end(), random);
      for (const std::size_t who : order) {
        times[who][batch].push_back(time_cast(*competitors[who].caster, rays, set.use));
      }
      if (round > 0) continue;
      const Batch judged(rays, set.use, *competitors.front().caster);
      for (std::size_t who = 1; who < competitors.size(); ++who) {
        agreements[who].add(judged.compare_last_cast(*competitors[who].caster, options.diagonal));
      }
    }
  }
  std::vector<RaceResult> results;
  for (std::size_t who = 0; who < competitors.size(); ++who) {
    results.push_back(result_of(times[who], set.rays.size(), agreements[who]));
  }
  return results;
}

}  // namespace perfect_bvh::bench
