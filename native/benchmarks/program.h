// What the programs that measure one mesh share: a command line in, JSON out.
#pragma once

#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>

#include "machine.h"
#include "quiet.h"

namespace perfect_bvh::bench {

// parse(count, values) returns the options, among them `json`, a path or empty, and `is_noisy`. bench(options) returns
// the text that goes to that path or to the console. Returns the program's exit code. Errors are printed as one line; a
// load that makes the results worthless is an error, unless is_noisy. Processor, caches and load are printed on stderr.
template <class Parse, class Bench>
[[nodiscard]] int run_program(int count, char** values, const Parse& parse, const Bench& bench) {
  try {
    const auto options = parse(count, values);
    const double load = load_average();
    if (const std::string objection = objection_to_load(load, options.is_noisy); !objection.empty()) {
      throw std::runtime_error(objection);
    }
    std::fprintf(stderr, "%s; load %.2f before\n", machine_name().c_str(), load);
    const std::string json = bench(options);
    std::fprintf(stderr, "%s; load %.2f before, %.2f after\n", machine_name().c_str(), load, load_average());
    if (options.json.empty()) {
      std::printf("%s\n", json.c_str());
    } else if (!(std::ofstream(options.json) << json << "\n")) {
      throw std::runtime_error("cannot write " + options.json);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace perfect_bvh::bench
