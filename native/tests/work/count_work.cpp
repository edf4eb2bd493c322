// This file itself must be compiled without reports.
#include "tests/work/count_work.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>
#include <thread>

extern "C" {
extern const char __executable_start, etext;  // from the linker
void __sanitizer_cov_trace_pc();              // called by the compiler in each block
}

namespace perfect_bvh::test {
namespace {

struct BlockCount {
  std::uint32_t stretch;  // the interval between two polls in which it ran last
  std::uint32_t runs;     // the number of runs in that interval
  std::uint32_t most_runs;
};

std::atomic<bool> is_counting{false};
std::atomic<std::uint32_t> stretch{0}, most{0}, waits_in_vain{0};
std::thread::id owner;

std::size_t code_size() noexcept { return static_cast<std::size_t>(&etext - &__executable_start); }

// One for each thread and code address.
std::span<BlockCount> counts() {
  thread_local const std::unique_ptr<BlockCount[]> all = std::make_unique<BlockCount[]>(code_size());
  return {all.get(), code_size()};
}

void wait_for_question(std::uint32_t before) noexcept {
  const auto start = std::chrono::steady_clock::now();
  while (stretch.load() == before && is_counting.load()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (std::chrono::steady_clock::now() - start < std::chrono::seconds(30)) continue;
    ++waits_in_vain;
    return;
  }
}

void count(std::size_t place) {
  const std::uint32_t now = stretch.load(std::memory_order_relaxed);
  BlockCount& block = counts()[place];
  if (block.stretch != now) block.stretch = now, block.runs = 0;
  ++block.runs;
  if (std::this_thread::get_id() == owner) {
    block.most_runs = std::max(block.most_runs, block.runs);
  } else if (block.runs == most.load(std::memory_order_relaxed)) {
    wait_for_question(now);
  }
}

// Returns the innermost function's file and line, then the function that it was inlined into.
std::string describe(std::size_t place) {
  char command[128];
  std::snprintf(command, sizeof(command), "addr2line -Cfpi -e /proc/%d/exe 0x%zx", getpid(), place - 1);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> lines(popen(command, "r"), pclose);
  if (!lines) throw std::runtime_error("end_counting: addr2line could not be started");
  std::string text;
  std::array<char, 512> part;
  while (std::fgets(part.data(), static_cast<int>(part.size()), lines.get()) != nullptr) text += part.data();
  if (text.empty()) throw std::runtime_error("end_counting: addr2line said nothing; install binutils");
  return text;
}

bool is_of_memory(std::string_view description) {
  const std::string_view innermost = description.substr(0, description.find('\n'));
  const auto names = [innermost](const char* file) { return innermost.find(file) != std::string_view::npos; };
  return names("/stl_uninitialized.h") || names("/stl_construct.h") || names("/alloc_traits.h") ||
         names("/vector.tcc") || names("/core/aligned.h") || names("/new_allocator.h") || names("std::__fill_");
}

}  // namespace

void begin_counting(std::uint32_t most_runs) {
  owner = std::this_thread::get_id();
  for (BlockCount& block : counts()) block = {};
  most = most_runs, waits_in_vain = 0;
  ++stretch;
  is_counting = true;
}

void count_from_here() noexcept { ++stretch; }

std::vector<std::string> end_counting() {
  is_counting = false;
  std::vector<std::string> found;
  const std::span<const BlockCount> all = counts();
  for (std::size_t place = 0; place < all.size(); ++place) {
    if (all[place].most_runs <= most) continue;
    const std::string description = describe(place);
    if (!is_of_memory(description)) found.push_back(std::to_string(all[place].most_runs) + " runs: " + description);
  }
  if (waits_in_vain > 0) found.push_back("another thread waited half a minute for a question\n");
  return found;
}

}  // namespace perfect_bvh::test

void __sanitizer_cov_trace_pc() {
  using namespace perfect_bvh::test;
  if (!is_counting.load(std::memory_order_relaxed)) return;
  const auto* const place = static_cast<const char*>(__builtin_return_address(0));
  if (place < &__executable_start || place >= &etext) return;
  count(static_cast<std::size_t>(place - &__executable_start));
}
