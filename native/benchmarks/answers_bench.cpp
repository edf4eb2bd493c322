// answers_bench --rays RAYS.bin --answers OUT.bin --json OUT.json [--peers a,b] [--strategies a,b] MESH.bin
//
// Writes the answers of every competitor, without times, for another program to judge. Competitors have the same names
// as in trace_bench. RAYS.bin: uint32 count, uint32 1 for any hit, float32 t_max; float32 origins and directions, 3 a
// ray. OUT.bin, for each competitor in the order of the names in OUT.json: float32 t (infinity on a miss) and int32
// triangles (-1 on a miss; for any hit 0 or -1, and t has no meaning).
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>

#include "arguments.h"
#include "embree_peer.h"
#include "json.h"
#include "our_rays.h"
#include "ray_sets.h"
#include "traverse/dispatch.h"
#include "tree_scene.h"
#include "ways.h"

namespace perfect_bvh::bench {
namespace {

struct Options {
  std::vector<std::string> peers, strategies{"auto"};
  std::string mesh, rays, answers, json;
};

Options parse(int count, char** values) {
  Options options;
  Arguments arguments(count, values);
  while (arguments.next()) {
    const std::string& name = arguments.name();
    if (name == "--peers") {
      options.peers = arguments.list();
    } else if (name == "--strategies") {
      options.strategies = arguments.list();
    } else if (name == "--rays") {
      options.rays = arguments.value();
    } else if (name == "--answers") {
      options.answers = arguments.value();
    } else if (name == "--json") {
      options.json = arguments.value();
    } else {
      options.mesh = arguments.path();
    }
  }
  return options;
}

RaySet read_rays(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint32_t header[2] = {0, 0};
  float t_max = 0;
  file.read(reinterpret_cast<char*>(header), sizeof(header));
  file.read(reinterpret_cast<char*>(&t_max), sizeof(t_max));
  std::vector<Vec3f> origins(header[0]), directions(header[0]);
  const auto bytes = static_cast<std::streamsize>(header[0] * sizeof(Vec3f));
  file.read(reinterpret_cast<char*>(origins.data()), bytes);
  file.read(reinterpret_cast<char*>(directions.data()), bytes);
  if (!file) throw std::runtime_error("cannot read " + path);
  RaySet set{path, {header[1] != 0, false}, std::vector<Ray>(header[0])};
  for (std::size_t i = 0; i < set.rays.size(); ++i) {
    set.rays[i].origin = to_double(origins[i]), set.rays[i].direction = to_double(directions[i]);
    set.rays[i].t_max = t_max;
  }
  return set;
}

RayCompetitor our_competitor(std::shared_ptr<const Snapshot> scene, const std::string& isa,
                             const std::string& strategy) {
  const std::string name = way_name(isa, strategy);
  const TraceOptions options{parse_strategy(strategy), 0};
  return {name, std::make_shared<OurRays>(std::move(scene), isa, options)};
}

void write_answers(std::ofstream& file, const RayCompetitor& competitor, const RaySet& set) {
  std::vector<float> t(set.rays.size(), 0.0f);
  std::vector<std::int32_t> triangles(set.rays.size());
  if (set.use.is_any_hit) {
    std::vector<std::uint8_t> occluded(set.rays.size());
    competitor.caster->answer(set.rays, set.use, std::span(occluded));
    for (std::size_t i = 0; i < triangles.size(); ++i) triangles[i] = occluded[i] != 0 ? 0 : -1;
  } else {
    std::vector<Hit> hits(set.rays.size());
    competitor.caster->answer(set.rays, set.use, std::span(hits));
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      t[i] = hits[i].found() ? hits[i].t : std::numeric_limits<float>::infinity();
      triangles[i] = hits[i].found() ? static_cast<std::int32_t>(hits[i].primitive_index) : -1;
    }
  }
  file.write(reinterpret_cast<const char*>(t.data()), static_cast<std::streamsize>(t.size() * sizeof(float)));
  file.write(reinterpret_cast<const char*>(triangles.data()),
             static_cast<std::streamsize>(triangles.size() * sizeof(std::int32_t)));
}

void answer(const Options& options) {
  const Mesh mesh = read_mesh(options.mesh);
  const RaySet set = read_rays(options.rays);
  const auto snapshot = committed(mesh, {});
  std::vector<RayCompetitor> competitors;
  for (const std::string& name : options.peers) {
    competitors.push_back(embree_competitor(name, std::make_shared<const EmbreePeer>(mesh, EmbreePeer::named(name))));
  }
  for (const KernelTable* table : available_kernels()) {
    for (const std::string& strategy : options.strategies) {
      competitors.push_back(our_competitor(snapshot, table->name, strategy));
    }
  }
  std::ofstream file(options.answers, std::ios::binary);
  std::vector<std::string> names;
  for (const RayCompetitor& competitor : competitors) {
    write_answers(file, competitor, set);
    names.push_back(to_json(competitor.name));
  }
  if (!file || !(std::ofstream(options.json) << to_json(names) << "\n")) {
    throw std::runtime_error("cannot write the answers");
  }
}

}  // namespace
}  // namespace perfect_bvh::bench

int main(int count, char** values) {
  try {
    perfect_bvh::bench::answer(perfect_bvh::bench::parse(count, values));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
