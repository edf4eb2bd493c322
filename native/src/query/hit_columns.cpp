#include "query/hit_columns.h"

#include "math/elementary.h"
#include "query/trace.h"

namespace perfect_bvh {
namespace {

void store(float* column, std::size_t row, Vec3d value) {
  column[3 * row] = static_cast<float>(value.x);
  column[3 * row + 1] = static_cast<float>(value.y);
  column[3 * row + 2] = static_cast<float>(value.z);
}

void store_identity(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit) {
  const bool found = hit.found();
  if (out.t) out.t[row] = hit.t;
  if (out.instance_ids) out.instance_ids[row] = found ? snapshot.instances[hit.instance_index].id : -1;
  if (out.mesh_ids) out.mesh_ids[row] = found ? snapshot.instances[hit.instance_index].mesh_id : -1;
  if (out.primitive_ids) out.primitive_ids[row] = found ? static_cast<std::int32_t>(hit.primitive_index) : -1;
  if (out.uvs) out.uvs[2 * row] = hit.u, out.uvs[2 * row + 1] = hit.v;
}

// The fields that need the triangle's corners.
void store_geometry(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit, const Ray& ray) {
  if (out.distances) {
    // Not length: the square of a tiny or huge direction is not a number that a double can hold.
    const Vec3d d = ray.direction;
    out.distances[row] = hit.found() ? static_cast<double>(hit.t) * hypotenuse(d.x, d.y, d.z) : kInfiniteDistance;
  }
  if (!out.normals && !out.positions && !out.front_face) return;
  Vec3d normal{0, 0, 0}, position{0, 0, 0};
  if (hit.found()) {
    normal = geometric_normal(snapshot, hit);
    position = hit_position(snapshot, hit);
  }
  if (out.normals) store(out.normals, row, normal);
  if (out.positions)
    out.positions[3 * row] = position.x, out.positions[3 * row + 1] = position.y,
                      out.positions[3 * row + 2] = position.z;
  if (out.front_face) out.front_face[row] = hit.found() && dot(normal, ray.direction) < 0 ? 1 : 0;
}

}  // namespace

void store_hit(const HitColumns& out, std::size_t row, const Snapshot& snapshot, const Hit& hit, const Ray& ray) {
  store_identity(out, row, snapshot, hit);
  store_geometry(out, row, snapshot, hit, ray);
}

}  // namespace perfect_bvh
