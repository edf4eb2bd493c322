#include "machine.h"

#include <cstdlib>
#include <fstream>
#include <stdexcept>

namespace perfect_bvh::bench {
namespace {

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "an unknown processor";
}

}  // namespace

std::string machine_name() {
  std::string caches;
  for (int index = 0;; ++index) {
    const std::string folder = "/sys/devices/system/cpu/cpu0/cache/index" + std::to_string(index) + "/";
    const std::string level = first_line(folder + "level"), type = first_line(folder + "type");
    const std::string size = first_line(folder + "size");  // not available on every processor
    if (level.empty()) break;
    if (type == "Instruction" || size.empty()) continue;
    caches += (caches.empty() ? "; L" : ", L") + level + (type == "Data" ? "d " : " ") + size;
  }
  return processor_name() + caches;
}

double load_average() {
  double minute = 0;
  if (getloadavg(&minute, 1) != 1) throw std::runtime_error("the system does not tell its load");
  return minute;
}

}  // namespace perfect_bvh::bench
