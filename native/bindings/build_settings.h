// What the Python face says of how a mesh's tree is to be built.
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "blas/build_tree.h"
#include "builders/builder.h"
#include "core/errors.h"

namespace perfect_bvh::bindings {

namespace py = pybind11;

inline BuildConfig parse_config(const py::dict& settings) {
  BuildConfig config;
  config.builder = find_builder(settings["builder"].cast<std::string>());
  config.optimize_passes = settings["optimize"].cast<std::uint32_t>();
  config.optimize_milliseconds = settings["optimize_milliseconds"].cast<double>();
  config.bins = settings["bins"].cast<std::uint32_t>();
  config.axes = settings["axes"].cast<std::uint32_t>();
  config.max_leaf_size = settings["max_leaf_size"].cast<std::uint32_t>();
  config.traversal_cost = settings["traversal_cost"].cast<float>();
  config.intersection_cost = settings["intersection_cost"].cast<float>();
  config.duplication_budget = settings["duplication_budget"].cast<float>();
  return config;
}

inline Usage parse_usage(const std::string& name) {
  if (name == "static") return Usage::kStatic;
  if (name == "deforming") return Usage::kDeforming;
  if (name == "changing") return Usage::kChanging;
  throw InvalidArgument("usage must be 'static', 'deforming' or 'changing', got '" + name + "'");
}

}  // namespace perfect_bvh::bindings
