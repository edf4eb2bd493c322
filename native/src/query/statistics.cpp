#include "query/statistics.h"

#include <map>

#include "blas/build_tree.h"
#include "builders/quality.h"
#include "mesh/round_mesh.h"
#include "wide/wide_quality.h"

namespace perfect_bvh {
namespace {

// Enough for the standard deviation to be known to half a per cent.
constexpr std::uint32_t kLineCount = 16384;

void add(PrimitiveCounts& counts, const Mesh& mesh) {
  std::size_t& count = mesh.kind == PrimitiveKind::kTriangles ? counts.triangles
                       : mesh.kind == PrimitiveKind::kCurves  ? counts.segments
                                                              : counts.points;
  count += mesh.primitive_count();
}

TreeStatistics describe(const TreeQuality& quality, const StatisticsOptions& options) {
  TreeStatistics row;
  row.node_count = quality.node_count;
  row.leaf_count = quality.leaf_count;
  row.reference_count = quality.reference_count;
  row.max_leaf_size = quality.max_leaf_size;
  row.depth = quality.depth;
  row.is_refittable = quality.is_refittable;
  row.sah = quality.sah_at(options.traversal_cost, options.intersection_cost);
  row.sibling_overlap = quality.sibling_overlap;
  return row;
}

void add_bytes(TreeStatistics& row, std::size_t geometry, const Bvh2& binary, const WideBvh& wide) {
  row.wide_node_count = wide.nodes.size();
  row.wide_leaf_count = wide.leaf_count();
  row.wide_depth = wide.depth;
  row.geometry_byte_count = geometry;
  row.binary_byte_count = binary.byte_count();
  row.wide_byte_count = wide.byte_count();
  row.byte_count = row.geometry_byte_count + row.binary_byte_count + row.wide_byte_count;
}

TreeStatistics describe_mesh(std::int32_t mesh_id, const Blas& blas, const StatisticsOptions& options) {
  const bool was_binary = blas.quality.node_count > 0;
  TreeStatistics row = describe(was_binary ? blas.quality : measure_wide_quality(blas.wide, blas.mesh), options);
  row.mesh_id = mesh_id;
  row.builder = builder_name(blas.config.builder);
  row.kind = kind_name(blas.mesh.kind);
  row.primitive_count = blas.mesh.primitive_count();
  row.vertex_count = blas.mesh.vertex_count();
  row.left_out_count = left_out_count(blas.mesh);
  add_bytes(row, blas.mesh.byte_count(), {}, blas.wide);
  row.plan_byte_count = plan_byte_count(blas);
  row.motion_byte_count = motion_byte_count(blas);
  row.byte_count += row.plan_byte_count + row.motion_byte_count;
  return row;
}

TreeStatistics describe_top_level(const Snapshot& snapshot, const StatisticsOptions& options) {
  TreeStatistics row = describe(measure_quality(snapshot.tlas), options);
  row.builder = snapshot.top_level_builder;
  row.kind = "instances";
  row.primitive_count = snapshot.instances.size();
  row.user_count = 1;
  add_bytes(row, snapshot.instances.size() * (sizeof(Instance) + sizeof(InstanceView)), snapshot.tlas,
            snapshot.top_level);
  row.motion_byte_count = motion_byte_count(snapshot);
  row.byte_count += row.motion_byte_count;
  return row;
}

// Builders are deterministic: built again, a tree is the one that it was.
void add_details(TreeStatistics& row, const Blas& blas, const StatisticsOptions& options, ThreadPool& pool,
                 CancelToken& cancel) {
  if (blas.quality.node_count == 0 && !blas.wide.is_empty) {  // there is no binary tree to tell of
    cancel.advance(2 * blas.mesh.primitive_count());
    return;
  }
  const Bvh2 tree = blas.mesh.primitive_count() > 0 ? build_tree(blas.mesh, blas.config, pool, cancel) : Bvh2{};
  if (blas.mesh.is_round()) {
    cancel.advance(blas.mesh.primitive_count());  // it is a measure of triangles' surfaces
  } else {
    row.epo = measure_epo(tree, blas.mesh.positions, blas.mesh.triangles, pool, cancel, options.traversal_cost,
                          options.intersection_cost);
  }
  row.leaf_count_variability = measure_leaf_count_variability(tree, kLineCount, pool, cancel);
}

}  // namespace

SceneStatistics measure(const Snapshot& snapshot, const StatisticsOptions& options, ThreadPool& pool,
                        CancelToken& cancel) {
  SceneStatistics result;
  std::map<std::int32_t, std::size_t> rows;
  std::size_t primitive_count = 0;
  for (const auto& [mesh_id, blas] : snapshot.meshes) {
    rows[mesh_id] = result.meshes.size();
    result.meshes.push_back(describe_mesh(mesh_id, *blas, options));
    add(result.distinct, blas->mesh);
    primitive_count += blas->mesh.primitive_count();
  }
  result.top_level = describe_top_level(snapshot, options);
  if (options.is_detailed) {
    cancel.expect(2 * primitive_count);
    for (std::size_t i = 0; i < snapshot.meshes.size(); ++i) {
      add_details(result.meshes[i], *snapshot.meshes[i].second, options, pool, cancel);
    }
    result.top_level.leaf_count_variability = measure_leaf_count_variability(snapshot.tlas, kLineCount, pool, cancel);
  }
  for (const Instance& instance : snapshot.instances) {
    add(result.instanced, instance.blas->mesh);
    if (const auto row = rows.find(instance.mesh_id); row != rows.end()) ++result.meshes[row->second].user_count;
  }
  result.instance_count = snapshot.instances.size();
  result.generation = snapshot.generation;
  result.byte_count = result.top_level.byte_count;
  for (const auto& blas : snapshot.blases) result.byte_count += byte_count(*blas);
  return result;
}

}  // namespace perfect_bvh
