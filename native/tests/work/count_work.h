// Counts work between two polls for cancellation, with the compiler's help: each piece of code without a branch (a
// basic block) reports when it runs. In: the engine compiled this way, see cmake/CountedWork.cmake. Out: the blocks
// that ran more often than allowed before the next poll. A loop over all items without a poll shows as a block that ran
// once per item. Unlike a clock, this is deterministic.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace perfect_bvh::test {

// Starts counting. `most`: how often a block may run between two polls. A thread other than this one that reaches the
// limit waits for the next poll, for half a minute at most.
void begin_counting(std::uint32_t most);
// Restarts the counts, at a poll.
void count_from_here() noexcept;
// Ends counting. Returns a line for each block that ran too often on the thread that began, with its position in the
// source, and a line if another thread waited in vain. Memory operations of vectors (constructing, filling, moving) are
// left out. Must be called on the thread that began. Requires binutils' addr2line.
[[nodiscard]] std::vector<std::string> end_counting();

}  // namespace perfect_bvh::test
