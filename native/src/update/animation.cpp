#include "update/animation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "update/wording.h"

namespace perfect_bvh {
namespace {

// Measured on cloth, two statues twisted and walking, a tree in the wind, crumpled paper, a chain and explosions, with
// 4, 8 and 16 shapes: of what rays lose in refitted trees, that for all frames kept 0.3 to 0.6, and none in the wind.
constexpr double kLossKept = 0.4;
// It took 5 to 10, 7 to 12 and 13 to 22 times as long to build as a binned one.
double build_factor(std::size_t shape_count) noexcept {
  return 5.0 + 0.75 * static_cast<double>(std::min(shape_count, kMostShapesBuiltFor));
}

// No tree of those was refitted to cost more than so many times what it did before; an explosion's aside, which is
// rebuilt.
constexpr double kMostDecay = 10.0;

struct Prices {
  double refit, rebuild, animate;  // of the whole mesh

  Prices(const AnimationQuestion& question, const Calibration& calibration) noexcept
      : refit(static_cast<double>(question.triangle_count) * calibration.refit_nanoseconds),
        rebuild(build_nanoseconds(question.triangle_count, BuilderKind::kBinned, calibration)),
        // Trees are refitted to all shapes to see what they cost.
        animate(build_factor(question.shape_count) * rebuild +
                2.0 * static_cast<double>(question.shape_count) * refit) {}
};

// What is known at shapes, frame by frame: between them in a straight line.
std::vector<double> by_frame(const std::vector<double>& at_shapes, std::uint32_t frame_count) {
  std::vector<double> values(frame_count);
  const double step = static_cast<double>(at_shapes.size() - 1) / std::max(frame_count - 1.0, 1.0);
  for (std::size_t frame = 0; frame < values.size(); ++frame) {
    const double place = static_cast<double>(frame) * step;
    const std::size_t before = std::min(static_cast<std::size_t>(place), at_shapes.size() - 2);
    values[frame] = std::lerp(at_shapes[before], at_shapes[before + 1], place - static_cast<double>(before));
  }
  return values;
}

// What a ray loses in the refitted tree.
std::vector<double> losses_by_frame(const AnimationQuestion& question) {
  std::vector<double> at_shapes(question.refitted.size());
  for (std::size_t i = 0; i < at_shapes.size(); ++i) {
    at_shapes[i] = std::max(question.refitted[i] - question.fresh[i], 0.0);
  }
  return by_frame(at_shapes, question.frame_count);
}

// What all frames cost, refits aside, if a tree is built every so many of them: the best number of them. The first tree
// is there.
double usual_nanoseconds(const AnimationQuestion& question, const Prices& prices, const std::vector<double>& losses) {
  const auto frames = static_cast<double>(question.frame_count);
  double least = std::numeric_limits<double>::infinity(), lost = 0;
  for (std::size_t i = 0; i < losses.size(); ++i) {
    lost += question.rays * losses[i];
    const double runs = frames / static_cast<double>(i + 1);
    least = std::min(least, runs * lost + (runs - 1.0) * std::max(prices.rebuild - prices.refit, 0.0));
  }
  return least;
}

double mean_of(const std::vector<double>& values) noexcept {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::string name_of(const AnimationQuestion& question, const Prices& prices, const char* verb) {
  return "one tree for the " + std::to_string(question.frame_count) + " frames to come " + verb + " " +
         as_time(prices.animate);
}

}  // namespace

bool may_animate(const AnimationQuestion& question, const Calibration& calibration) noexcept {
  const Prices prices(question, calibration);
  const auto frames = static_cast<double>(question.frame_count);
  const double most_lost = frames * question.rays * kMostDecay * question.ray_nanoseconds;
  return prices.animate < std::min(most_lost, (frames - 1.0) * (prices.rebuild - prices.refit));
}

AnimationDecision decide_animation(const AnimationQuestion& question, const Calibration& calibration) {
  const Prices prices(question, calibration);
  const auto frames = static_cast<double>(question.frame_count);
  AnimationDecision decision;
  double ray = question.ray_nanoseconds;
  if (question.refitted.size() < 2) {
    decision.words = name_of(question, prices, "would take") + ", more than it could save";
  } else {
    const std::vector<double> losses = losses_by_frame(question);
    const double lost = frames * question.rays * kLossKept * mean_of(losses);
    const double saved = usual_nanoseconds(question, prices, losses) - lost;
    decision.builds = saved > prices.animate;
    decision.words = decision.builds ? name_of(question, prices, "is built for") + " and is to save "
                                     : name_of(question, prices, "would take") + " and save ";
    decision.words += as_time(saved);
    ray = mean_of(by_frame(question.refitted, question.frame_count)) - (1.0 - kLossKept) * mean_of(losses);
  }
  decision.alternative = {UpdateAction::kAnimate, BuilderKind::kBinned, prices.animate / frames + prices.refit,
                          question.rays * ray};
  return decision;
}

bool is_cheaper(const std::vector<double>& costs, const std::vector<double>& refitted) noexcept {
  return mean_of(costs) < mean_of(refitted);
}

Foreseen foresee(const std::vector<double>& costs, std::uint32_t frame_count) noexcept {
  return {kForeseenMargin * std::ranges::max(costs), frame_count - 1};
}

}  // namespace perfect_bvh
