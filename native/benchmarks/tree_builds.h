// Measures how long builds take, from a mesh in memory until rays can be cast. Competitors take turns, and the order
// rotates from round to round. For our trees the binary tree is also timed alone. Cold, each build runs in a new
// process, which finds no memory that earlier builds freed, as in a program that has just started; warm, all run in
// this process.
// With one thread the time is the thread's own CPU time, otherwise wall-clock time.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "tree_choice.h"

namespace perfect_bvh::bench {

// Stages of our builds, as the engine's own report names them, in wall-clock time.
inline constexpr const char* kStages[] = {"build", "optimize", "collapse", "top level"};

// One engine's way to build a tree.
struct Builder {
  std::string name;
  // Runs one build. Returns the milliseconds until rays can be cast, then for ours those of each of kStages, for Embree
  // the bytes.
  std::function<std::vector<double>()> ready;
  std::function<std::vector<double>()> binary;  // ours: milliseconds to the binary tree alone

  std::vector<double> ready_ms, build_ms;
  std::vector<std::vector<double>> stage_ms;  // by stage
  std::size_t byte_count = 0;                 // Embree's

  [[nodiscard]] bool is_ours() const { return binary != nullptr; }
};

// The mesh must outlive them. peer: embree_low, embree_medium or embree_high; throws std::runtime_error for others.
[[nodiscard]] Builder our_builder(const TreeChoice& choice, const Mesh& mesh, int thread_count);
[[nodiscard]] Builder embree_builder(const std::string& peer, const Mesh& mesh, int thread_count);

struct BuildRace {
  int rounds = 5;            // at least
  double least_seconds = 0;  // rounds go on at least this long: the times of short builds vary
  double seconds = 60;       // no round starts after this time
  bool is_cold = true;
  std::function<void(double)> tell = [](double) {};  // called with the finished share
};

// Adds the times of each round to the builders.
void race_builds(std::vector<Builder>& builders, const BuildRace& race);

}  // namespace perfect_bvh::bench
