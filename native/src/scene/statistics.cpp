#include "scene/statistics.h"

#include <map>

#include "update/quality.h"

namespace perfect_bvh {
namespace {

TreeStatistics measure_tree(const Bvh2& tree) {
  const TreeQuality quality = measure_quality(tree);
  TreeStatistics result;
  result.node_count = quality.node_count;
  result.leaf_count = quality.leaf_count;
  result.reference_count = quality.reference_count;
  result.depth = quality.depth;
  result.sah = quality.sah;
  result.byte_count = tree.byte_count();
  return result;
}

}  // namespace

SceneStatistics measure(const Snapshot& snapshot) {
  SceneStatistics result;
  std::map<std::int32_t, std::size_t> rows;
  for (const auto& [mesh_id, blas] : snapshot.meshes) {
    rows[mesh_id] = result.meshes.size();
    TreeStatistics& row = result.meshes.emplace_back(measure_tree(blas->tree));
    row.mesh_id = mesh_id;
    row.builder = builder_name(blas->builder);
    row.primitive_count = blas->mesh.triangle_count();
    row.vertex_count = blas->mesh.positions.size();
    row.byte_count += blas->mesh.byte_count() + blas->wide.byte_count();
    result.triangle_count += row.primitive_count;
  }
  result.top_level = measure_tree(snapshot.tlas);
  result.top_level.builder = snapshot.top_level_builder;
  result.top_level.primitive_count = snapshot.instances.size();
  result.top_level.byte_count += snapshot.instances.size() * (sizeof(Instance) + sizeof(InstanceView));
  result.top_level.byte_count += snapshot.top_level.byte_count();
  for (const Instance& instance : snapshot.instances) {
    result.instanced_triangle_count += instance.blas->mesh.triangle_count();
    if (const auto row = rows.find(instance.mesh_id); row != rows.end()) ++result.meshes[row->second].user_count;
  }
  result.instance_count = snapshot.instances.size();
  result.generation = snapshot.generation;
  result.byte_count = result.top_level.byte_count;
  for (const auto& blas : snapshot.blases) {
    result.byte_count += blas->mesh.byte_count() + blas->tree.byte_count() + blas->wide.byte_count();
  }
  return result;
}

}  // namespace perfect_bvh
