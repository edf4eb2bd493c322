// Reads a program's command line one argument at a time, and the options that several programs share.
#pragma once

#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace perfect_bvh::bench {

[[nodiscard]] inline std::vector<std::string> split(const std::string& text, char separator = ',') {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

class Arguments {
 public:
  Arguments(int count, char** values) : count_(count), values_(values) {}

  // Goes to the next option or mesh path; false at the end.
  bool next() {
    if (++at_ >= count_) return false;
    name_ = values_[at_];
    return true;
  }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

  // Returns the argument as a mesh's path. Throws std::runtime_error if it is an option: the program has none of that
  // name.
  [[nodiscard]] const std::string& path() const {
    if (name_.starts_with("--")) throw std::runtime_error("there is no option " + name_);
    return name_;
  }

  // Returns the value that follows the option. Throws std::runtime_error if there is none.
  [[nodiscard]] std::string value() {
    if (++at_ >= count_) throw std::runtime_error(name_ + " needs a value");
    return values_[at_];
  }
  [[nodiscard]] std::vector<std::string> list() { return split(value()); }
  // Reads WxH.
  [[nodiscard]] std::pair<std::uint32_t, std::uint32_t> size() {
    const std::vector<std::string> parts = split(value(), 'x');
    if (parts.size() != 2) throw std::runtime_error(name_ + " wants WxH");
    return {static_cast<std::uint32_t>(std::stoul(parts[0])), static_cast<std::uint32_t>(std::stoul(parts[1]))};
  }

 private:
  const int count_;
  char** const values_;
  int at_ = 0;
  std::string name_;
};

// Options of every program that measures times.
struct CommonOptions {
  int rounds = 5;                           // --rounds N
  std::uint32_t width = 640, height = 400;  // --size WxH, of the image of primary rays
  std::string json;                         // --json OUT.json
  bool is_noisy = false;                    // --noisy: measure at any load
};

// Sets what the argument names; false if it is none of these options.
[[nodiscard]] inline bool set_common(CommonOptions& options, Arguments& arguments) {
  const std::string& name = arguments.name();
  if (name == "--rounds") {
    options.rounds = std::stoi(arguments.value());
  } else if (name == "--size") {
    std::tie(options.width, options.height) = arguments.size();
  } else if (name == "--json") {
    options.json = arguments.value();
  } else if (name == "--noisy") {
    options.is_noisy = true;
  } else {
    return false;
  }
  return true;
}

}  // namespace perfect_bvh::bench
