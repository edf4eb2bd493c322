// The few kinds of JSON that benchmarks write.
#pragma once

#include <concepts>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "stopwatch.h"

namespace perfect_bvh::bench {

[[nodiscard]] inline std::string to_json(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}
[[nodiscard]] inline std::string to_json(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.9g", value);
  return text;
}
[[nodiscard]] inline std::string to_json(const std::optional<double>& value) {
  return value ? to_json(*value) : "null";
}
[[nodiscard]] inline std::string to_json(std::integral auto value) { return std::to_string(value); }
[[nodiscard]] inline std::string to_json(const std::vector<std::string>& rows) {
  std::string text = "[";
  for (std::size_t i = 0; i < rows.size(); ++i) text += (i == 0 ? "" : ", ") + rows[i];
  return text + "]";
}

class JsonObject {
 public:
  template <class T>
  JsonObject& add(const char* key, const T& value) {
    return add_raw(key, to_json(value));
  }
  JsonObject& add_raw(const char* key, const std::string& json) {
    text_ += (text_.empty() ? "\"" : ", \"") + std::string(key) + "\": " + json;
    return *this;
  }
  [[nodiscard]] std::string text() const { return "{" + text_ + "}"; }

 private:
  std::string text_;
};

[[nodiscard]] inline std::string to_json(const Spread& spread) {
  return JsonObject().add("median", spread.median).add("low", spread.low).add("high", spread.high).text();
}

}  // namespace perfect_bvh::bench
