// What the owner of a mesh expects to happen to it.
#pragma once

#include <cstdint>

namespace perfect_bvh {

enum class Usage : std::uint8_t {
  kStatic,     // nothing, or rigid motion
  kDeforming,  // its positions change
  kChanging,   // its topology changes
};

}  // namespace perfect_bvh
