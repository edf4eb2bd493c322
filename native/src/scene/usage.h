// What the owner of a mesh expects to happen to it.
#pragma once

#include <cstdint>

namespace perfect_bvh {

enum class Usage : std::uint8_t {
  kStatic,     // nothing, or rigid motion
  kDeforming,  // its positions change
  kChanging,   // its topology changes
};

// As users write it.
[[nodiscard]] constexpr const char* usage_name(Usage usage) noexcept {
  switch (usage) {
    case Usage::kStatic:
      return "static";
    case Usage::kDeforming:
      return "deforming";
    case Usage::kChanging:
      return "changing";
  }
  return "";
}

}  // namespace perfect_bvh
