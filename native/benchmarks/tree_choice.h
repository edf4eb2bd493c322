// One of our trees as a command line names it: "binned, 4 bins:binned,bins=4".
#pragma once

#include <string>

#include "build/build_config.h"

namespace perfect_bvh::bench {

struct TreeChoice {
  std::string name;
  BuildConfig config;
};

// "NAME:BUILDER[,SETTING=VALUE...]" with the settings of Python's BuildConfig. Throws std::runtime_error.
[[nodiscard]] TreeChoice parse_tree(const std::string& text);

}  // namespace perfect_bvh::bench
