// How long trees take: from a mesh in memory until rays can be cast, by every competitor in turn, the order rotating
// from round to round; of ours also the binary tree alone. Cold, each build runs in a process of its own, which finds
// no memory that others gave back, as in a program that has just begun; warm, all run in this one.
// With one thread the time is the thread's own CPU time, otherwise that of the wall clock.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "tree_choice.h"

namespace perfect_bvh::bench {

// Of ours, as the engine's own report has them, by the wall clock.
inline constexpr const char* kStages[] = {"build", "optimize", "collapse", "top level"};

// One engine's way to a tree.
struct Builder {
  std::string name;
  // One build: milliseconds until rays can be cast; then ours: of each of kStages; Embree: the bytes it holds then.
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
  double least_seconds = 0;  // rounds go on until so much time has gone: short builds differ from one to the next
  double seconds = 60;       // no round starts after that many
  bool is_cold = true;
  std::function<void(double)> tell = [](double) {};  // called with the share that is done
};

// Adds the times of each round to the builders.
void race_builds(std::vector<Builder>& builders, const BuildRace& race);

}  // namespace perfect_bvh::bench
