// What the programs share that measure one mesh: a command line in, JSON out.
#pragma once

#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>

namespace perfect_bvh::bench {

// parse(count, values) gives the options, among them `json`, a path or nothing; bench(options) the text that goes there
// or to the console. Returns the program's exit code; errors are told in a line.
template <class Parse, class Bench>
[[nodiscard]] int run_program(int count, char** values, const Parse& parse, const Bench& bench) {
  try {
    const auto options = parse(count, values);
    const std::string json = bench(options);
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
