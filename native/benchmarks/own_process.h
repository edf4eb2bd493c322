// Work in a process of its own, so that it finds memory as a program does that has just begun: no pages that were
// handed out before, no lists of freed blocks.
#pragma once

#include <functional>
#include <vector>

namespace perfect_bvh::bench {

// The numbers that `work` returns, from a child process. This process must not have started threads that the work
// needs. Throws std::runtime_error if the child fails, after it has said why.
[[nodiscard]] std::vector<double> run_in_own_process(const std::function<std::vector<double>()>& work);

}  // namespace perfect_bvh::bench
