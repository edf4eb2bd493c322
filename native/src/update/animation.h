// Decides whether one tree for all frames of an animation pays, where its shapes are known beforehand (lecture,
// "Refitting": when a tree suits what it is refitted to).
// In: what a ray costs at several of the frames, in the tree that there is, refitted, and in fresh ones; how many
// frames and rays are to come. Out: whether to build a tree for all of them, why, and what it was expected to cost.
// Pure functions.
//
// What it is weighed against is what the governor does otherwise: to refit, and to rebuild every k frames, at the k
// that costs least. A tree so many frames old is taken to lose what the one that there is would lose that many frames
// on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "update/governor.h"

namespace perfect_bvh {

// Up to so much more than foreseen a ray may cost before the tree for all frames is questioned.
inline constexpr double kForeseenMargin = 1.1;

// The tree is optimised for so many of the shapes at most, at equal intervals: with 16 it was no better than with 8, at
// twice the time, with 4 hardly worse. All of them tell how trees decay.
inline constexpr std::size_t kMostShapesBuiltFor = 8;

struct AnimationQuestion {
  std::size_t triangle_count = 0;
  std::size_t shape_count = 0;  // known, at equal intervals of the frames, the first and the last among them
  std::uint32_t frame_count = 0;
  double rays = 0;               // a frame, expected to meet the mesh's box
  double ray_nanoseconds = 0;    // in the tree that there is, now
  std::vector<double> refitted;  // the same at each shape; empty where it is not worth finding out ...
  std::vector<double> fresh;     // ... and in a tree built for it
};

struct AnimationDecision {
  bool builds = false;
  std::string words;        // for the report, after the reason for what else was done
  Alternative alternative;  // of one frame, in the mean
};

// Whether it is worth finding out how the tree that there is decays: whether any decay could repay building another.
[[nodiscard]] bool may_animate(const AnimationQuestion& question, const Calibration& calibration) noexcept;

[[nodiscard]] AnimationDecision decide_animation(const AnimationQuestion& question, const Calibration& calibration);

// Of a tree that was built for all frames: what a ray costs in it, refitted to each of the shapes, beside what it does
// in the tree that there was.
[[nodiscard]] bool is_cheaper(const std::vector<double>& costs, const std::vector<double>& refitted) noexcept;
[[nodiscard]] Foreseen foresee(const std::vector<double>& costs, std::uint32_t frame_count) noexcept;

}  // namespace perfect_bvh
