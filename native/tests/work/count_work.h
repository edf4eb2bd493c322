// Work between two questions whether to stop, counted by the compiler: each piece of code without a branch (a basic
// block) reports when it runs. In: the engine compiled so, see cmake/CountedWork.cmake. Out: the blocks that ran more
// often than they may before the next question. A loop over all items that asks nothing shows as a block that ran once
// an item, whatever else it does; deterministic, unlike a clock.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace perfect_bvh::test {

// From now on work is counted. `most`: how often a block may run between two questions. Threads other than this one
// wait for the next question then, for half a minute at most.
void begin_counting(std::uint32_t most);
// A question is asked: counts begin again.
void count_from_here() noexcept;
// A line for each block that ran too often on the thread that began, with its place in the source, and one if another
// thread waited in vain. What vectors do with memory (constructing, filling, moving) is left out. To be called where
// counting began. Wants binutils' addr2line.
[[nodiscard]] std::vector<std::string> end_counting();

}  // namespace perfect_bvh::test
