// One of our trees, as named on a command line: "binned, 4 bins:binned,bins=4".
#pragma once

#include <string>

#include "blas/build_tree.h"
#include "builders/builder.h"

namespace perfect_bvh::bench {

struct TreeChoice {
  std::string name;
  BuildConfig config;
  Usage usage = Usage::kStatic;
};

// Parses "NAME:BUILDER[,SETTING=VALUE...]" with the settings of Python's BuildConfig, and usage=static, deforming or
// changing, as in add_mesh. Throws std::runtime_error.
[[nodiscard]] TreeChoice parse_tree(const std::string& text);

}  // namespace perfect_bvh::bench
