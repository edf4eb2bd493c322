// The point of a triangle nearest to the origin, four triangles at a time, in double.
// Three candidates on the edges and one inside, each a point of the triangle; the nearest wins. So what comes out is
// never less than the true distance, and where a needle's normal is no more than noise its edges still answer.
// The operations are fixed, so that a triangle has one distance whatever its lane and instruction set.
#pragma once

#include "math/double4.h"

namespace perfect_bvh {

struct Vectors4 {
  Double4 x, y, z;
};

PERFECT_BVH_LANES Vectors4 minus(const Vectors4& a, const Vectors4& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
PERFECT_BVH_LANES Double4 dot4(const Vectors4& a, const Vectors4& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
PERFECT_BVH_LANES Vectors4 cross4(const Vectors4& a, const Vectors4& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
PERFECT_BVH_LANES Vectors4 moved(const Vectors4& from, const Vectors4& along, const Double4& share) noexcept {
  return {from.x + along.x * share, from.y + along.y * share, from.z + along.z * share};
}

// The point is (1 - u - v) a + u b + v c, `squared` its squared distance.
struct NearestOnTriangles {
  Double4 squared, u, v;

  PERFECT_BVH_LANES void offer(NearestOnTriangles& best, const Double4& squared, const Double4& u, const Double4& v,
                               const Mask4& allowed) noexcept {
    const Mask4 nearer = (squared < best.squared) & allowed;
    best.squared = nearer ? squared : best.squared;
    best.u = nearer ? u : best.u;
    best.v = nearer ? v : best.v;
  }
};

// Where on the edge from `from` along `edge` the origin is nearest, 0 to 1; 0 on an edge without length.
PERFECT_BVH_LANES Double4 nearest_share(const Vectors4& from, const Vectors4& edge) noexcept {
  const Double4 none = {0.0, 0.0, 0.0, 0.0}, whole = {1.0, 1.0, 1.0, 1.0};
  const Double4 share = -dot4(from, edge) / dot4(edge, edge);
  const Double4 positive = share > none ? share : none;  // NaN becomes 0
  return positive < whole ? positive : whole;
}

// At the far end it is that corner itself, so that triangles which share it have one distance.
PERFECT_BVH_LANES Double4 edge_distance(const Vectors4& from, const Vectors4& to, const Vectors4& edge,
                                        const Double4& share) noexcept {
  const Vectors4 point = moved(from, edge, share);
  const Double4 whole = {1.0, 1.0, 1.0, 1.0};
  return share < whole ? dot4(point, point) : dot4(to, to);
}

PERFECT_BVH_LANES NearestOnTriangles nearest_to_origin(const Vectors4& a, const Vectors4& b,
                                                       const Vectors4& c) noexcept {
  const Double4 none = {0.0, 0.0, 0.0, 0.0}, whole = {1.0, 1.0, 1.0, 1.0};
  const Mask4 always = none == none;
  const Vectors4 to_b = minus(b, a), to_c = minus(c, a), across = minus(c, b);
  const Double4 along_b = nearest_share(a, to_b), along_c = nearest_share(a, to_c), between = nearest_share(b, across);
  NearestOnTriangles best{edge_distance(a, b, to_b, along_b), along_b, none};
  NearestOnTriangles::offer(best, edge_distance(a, c, to_c, along_c), none, along_c, always);
  NearestOnTriangles::offer(best, edge_distance(b, c, across, between), whole - between, between, always);
  const Vectors4 normal = cross4(to_b, to_c);
  const Double4 area = dot4(normal, normal);  // 0: u and v are NaN, and nothing is inside
  const Double4 u = dot4(cross4(to_c, a), normal) / area;
  const Double4 v = dot4(cross4(a, to_b), normal) / area;
  const Vectors4 inside = moved(moved(a, to_b, u), to_c, v);
  NearestOnTriangles::offer(best, dot4(inside, inside), u, v, (u >= none) & (v >= none) & (u + v <= whole));
  return best;
}

}  // namespace perfect_bvh
