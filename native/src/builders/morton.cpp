#include "builders/morton.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/cancel.h"

namespace perfect_bvh {
namespace {

constexpr unsigned kMostDigitBits = 11;
constexpr std::size_t kMaxDigits = 3;
constexpr std::size_t kFewestToShare = 65536;  // fewer items are sorted by one thread

using Items = std::span<std::uint64_t>;
using Histogram = std::array<std::uint32_t, 1u << kMostDigitBits>;

[[nodiscard]] constexpr std::size_t digit_count(unsigned bit_count) noexcept {
  return (bit_count + kMostDigitBits - 1) / kMostDigitBits;
}

// Digits of similar width: scattering to fewer positions stays in the cache.
struct Digit {
  unsigned shift;
  std::uint64_t mask;

  Digit(unsigned first_bit, unsigned bit_count, std::size_t number) noexcept {
    const auto count = static_cast<unsigned>(digit_count(bit_count));
    const unsigned width = (bit_count + count - 1) / count;
    const unsigned begin = static_cast<unsigned>(number) * width;
    shift = first_bit + begin;
    mask = (std::uint64_t{1} << std::min(width, bit_count - begin)) - 1;
  }
  [[nodiscard]] std::size_t of(std::uint64_t item) const noexcept {
    return static_cast<std::size_t>((item >> shift) & mask);
  }
};

void scatter(Items items, const Digit& digit, Histogram& places, Items to, CancelToken& cancel) {
  for_steps(items.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint64_t item : items.subspan(begin, end - begin)) to[places[digit.of(item)]++] = item;
  });
}

}  // namespace

Items radix_sort(Items items, Items scratch, unsigned first_bit, unsigned bit_count, CancelToken& cancel) {
  std::array<Histogram, kMaxDigits> histograms{};
  const std::size_t count = digit_count(bit_count);
  const std::array<Digit, kMaxDigits> digits{Digit(first_bit, bit_count, 0),
                                             Digit(first_bit, bit_count, std::min<std::size_t>(1, count - 1)),
                                             Digit(first_bit, bit_count, std::min<std::size_t>(2, count - 1))};
  for_steps(items.size(), cancel, [&](std::size_t begin, std::size_t end) {
    for (const std::uint64_t item : items.subspan(begin, end - begin)) {
      for (std::size_t i = 0; i < count; ++i) ++histograms[i][digits[i].of(item)];
    }
  });
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t start = 0;
    for (std::uint32_t& place : histograms[i]) start += std::exchange(place, start);
    scatter(items, digits[i], histograms[i], scratch, cancel);
    std::swap(items, scratch);
  }
  return items;
}

// Every thread counts and then scatters a separate part.
Items radix_sort(Items items, Items scratch, unsigned first_bit, unsigned bit_count, ThreadPool& pool,
                 CancelToken& cancel) {
  if (pool.thread_count() == 1 || items.size() < kFewestToShare) {
    return radix_sort(items, scratch, first_bit, bit_count, cancel);
  }
  const std::size_t part = items.size() / static_cast<std::size_t>(pool.thread_count()) + 1;
  std::vector<Histogram> histograms((items.size() + part - 1) / part);
  for (std::size_t i = 0; i < digit_count(bit_count); ++i) {
    const Digit digit(first_bit, bit_count, i);
    for_chunks(pool, items.size(), part, cancel, [&](std::size_t begin, std::size_t end) {
      Histogram& histogram = histograms[begin / part];
      histogram.fill(0);
      for_steps(end - begin, cancel, [&](std::size_t first, std::size_t last) {
        for (std::size_t row = begin + first; row < begin + last; ++row) ++histogram[digit.of(items[row])];
      });
    });
    std::uint32_t start = 0;
    for (std::size_t value = 0; value < Histogram{}.size(); ++value) {
      for (Histogram& histogram : histograms) start += std::exchange(histogram[value], start);
    }
    for_chunks(pool, items.size(), part, cancel, [&](std::size_t begin, std::size_t end) {
      scatter(items.subspan(begin, end - begin), digit, histograms[begin / part], scratch, cancel);
    });
    std::swap(items, scratch);
  }
  return items;
}

}  // namespace perfect_bvh
