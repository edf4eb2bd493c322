// Memory that starts on cache lines: arrays, and scratch memory that is divided into many parts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/aligned.h"

namespace perfect_bvh::test {
namespace {

TEST(Aligned, StartsOnACacheLineAndKeepsItsContents) {
  for (const std::size_t count : {1u, 3u, 1000u, 300'000u, 1'048'576u}) {  // the last ones use huge pages
    AlignedVector<std::uint32_t> values(count);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(values.data()) % kCacheLine, 0u);
    std::iota(values.begin(), values.end(), 0u);
    values.resize(count * 10);
    for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(values[i], i);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(values.data()) % kCacheLine, 0u);
  }
}

TEST(Aligned, InitialisesWhatHasDefaults) {
  struct WithDefault {
    int value = 7;
  };
  const AlignedVector<WithDefault> values(100);
  for (const auto& each : values) EXPECT_EQ(each.value, 7);
}

TEST(Aligned, RefusesImpossibleSizes) {
  AlignedVector<std::uint64_t> values;
  volatile std::size_t too_many = values.max_size() + 1;  // volatile: otherwise the compiler warns
  EXPECT_THROW(values.resize(too_many), std::length_error);
}

TEST(ScratchMemory, GivesPartsThatStandApart) {
  Scratch scratch;
  scratch.expect(1'000'000);
  std::vector<std::span<std::uint32_t>> parts;
  for (const std::size_t count : {1u, 100u, 0u, 17u, 200'000u, 1'000'000u, 3u}) {  // also more than expected
    parts.push_back(scratch.take<std::uint32_t>(count));
    ASSERT_EQ(parts.back().size(), count);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(parts.back().data()) % kCacheLine, 0u);
    std::fill(parts.back().begin(), parts.back().end(), static_cast<std::uint32_t>(parts.size()));
  }
  const auto trimmed = scratch.take<std::uint32_t>(1000);
  scratch.trim(trimmed, 20);
  const auto behind = scratch.take<std::uint32_t>(500);
  EXPECT_EQ(behind.data(), trimmed.data() + 32) << "on the next cache line";
  std::fill(behind.begin(), behind.end(), 0u);
  std::fill(trimmed.begin(), trimmed.begin() + 20, 100u);
  for (const std::uint32_t value : behind) EXPECT_EQ(value, 0u);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (const std::uint32_t value : parts[i]) ASSERT_EQ(value, i + 1);
  }
}

}  // namespace
}  // namespace perfect_bvh::test
