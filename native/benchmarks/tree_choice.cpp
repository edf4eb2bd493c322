#include "tree_choice.h"

#include <sstream>
#include <stdexcept>

#include "builders/builder.h"

namespace perfect_bvh::bench {
namespace {

void set(BuildConfig& config, const std::string& setting, const std::string& value) {
  const auto whole = [&] { return static_cast<std::uint32_t>(std::stoul(value)); };
  if (setting == "optimize") {
    config.optimize_passes = whole();
  } else if (setting == "bins") {
    config.bins = whole();
  } else if (setting == "axes") {
    config.axes = whole();
  } else if (setting == "max_leaf_size") {
    config.max_leaf_size = whole();
  } else if (setting == "traversal_cost") {
    config.traversal_cost = std::stof(value);
  } else if (setting == "intersection_cost") {
    config.intersection_cost = std::stof(value);
  } else if (setting == "duplication_budget") {
    config.duplication_budget = std::stof(value);
  } else {
    throw std::runtime_error("no setting is called " + setting);
  }
}

Usage parse_usage(const std::string& name) {
  for (const Usage usage : {Usage::kStatic, Usage::kDeforming, Usage::kChanging}) {
    if (name == usage_name(usage)) return usage;
  }
  throw std::runtime_error("no usage is called " + name);
}

}  // namespace

TreeChoice parse_tree(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) throw std::runtime_error("--tree wants NAME:BUILDER, got " + text);
  TreeChoice choice{text.substr(0, colon), {}, Usage::kStatic};
  std::istringstream parts(text.substr(colon + 1));
  std::string part;
  std::getline(parts, part, ',');
  choice.config.builder = find_builder(part);
  while (std::getline(parts, part, ',')) {
    const std::size_t equals = part.find('=');
    if (equals == std::string::npos) throw std::runtime_error("--tree wants SETTING=VALUE, got " + part);
    const std::string setting = part.substr(0, equals), value = part.substr(equals + 1);
    if (setting == "usage") {
      choice.usage = parse_usage(value);
    } else {
      set(choice.config, setting, value);
    }
  }
  return choice;
}

}  // namespace perfect_bvh::bench
