// Runs work in a new process, so that its memory is that of a program that has just started: no pages that were
// allocated before, no lists of freed blocks.
#pragma once

#include <functional>
#include <vector>

namespace perfect_bvh::bench {

// Returns the numbers that `work` computes in a child process. This process must not have started threads that the work
// needs. If the child fails, it prints the reason, and this throws std::runtime_error.
[[nodiscard]] std::vector<double> run_in_own_process(const std::function<std::vector<double>()>& work);

}  // namespace perfect_bvh::bench
