// refit_bench [options] MESH.bin
//   --threads N      of both sides, for updates (1)      --rounds N         interleaved rounds; 0: no swaying mesh (9)
//   --twists a,b     radians from end to end (0.1,1.5,6.2831853)
//   --ray-rounds N   interleaved rounds of rays; 0: no twists (5)
// --size WxH       of the image of primary rays (640x400)
// --json OUT.json  --noisy  measure at any load
//
// A mesh that sways (sway_race.h), then the mesh twisted in one step (twist_race.h).
#include <stdexcept>

#include "arguments.h"
#include "json.h"
#include "program.h"
#include "ray_sets.h"
#include "sway_race.h"
#include "traverse/dispatch.h"
#include "twist_race.h"

namespace perfect_bvh::bench {
namespace {

RefitOptions parse(int count, char** values) {
  RefitOptions options;
  Arguments arguments(count, values);
  while (arguments.next()) {
    const std::string& name = arguments.name();
    if (set_common(options, arguments)) continue;
    if (name == "--threads") {
      options.threads = std::stoi(arguments.value());
    } else if (name == "--ray-rounds") {
      options.ray_rounds = std::stoi(arguments.value());
    } else if (name == "--twists") {
      options.twists.clear();
      for (const std::string& twist : arguments.list()) options.twists.push_back(std::stof(twist));
    } else {
      options.mesh = arguments.path();
    }
  }
  if (options.mesh.empty()) throw std::runtime_error("refit_bench: no mesh given");
  return options;
}

std::string bench(const RefitOptions& options) {
  const Mesh mesh = read_mesh(options.mesh);
  JsonObject result;
  result.add("triangle_count", mesh.primitive_count()).add("threads", options.threads);
  result.add("isa", std::string(active_kernels().name));
  if (options.rounds > 0) result.add("sway", race_sway(mesh, options));
  std::vector<std::string> rows;
  if (options.ray_rounds > 0) {
    for (const float radians : options.twists) {
      for (std::string& row : race_twist(mesh, radians, options)) rows.push_back(std::move(row));
    }
  }
  return result.add("twists", rows).text();
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  return perfect_bvh::bench::run_program(count, values, perfect_bvh::bench::parse, perfect_bvh::bench::bench);
}
