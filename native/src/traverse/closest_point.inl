// Finds the nearest point of a scene's triangles, curves and points to each of a batch of points.
// Distances are in world space, for any transform. M = Q R with Q a rotation and R upper triangular. So in the world
// rotated by Q, a point of the tree is R x, and distances do not change. R is diagonal unless the transform shears. If
// it is diagonal, a child's box is tight there; otherwise its projection on each axis bounds it.
// Everything is in double, eight children or triangles as two times four, with fixed operations. So a triangle has the
// same distance on every instruction set, however far away the point is.
// Included by one translation unit for each instruction set; everything has internal linkage.

namespace perfect_bvh {
namespace {

// A point as one tree sees it.
struct PointFrame {
  double r[6];                             // rows 00 01 02, 11 12, 22, from the tree's stored units
  double q[3];                             // the point, rotated
  double low[3], high[3];                  // minus and plus the rounding of a box's projection
  std::size_t lower_row[6], upper_row[6];  // byte offsets in a node: the planes that make a projection's ends
};

struct PointEntry {
  double squared;  // a lower bound of the distance
  std::uint32_t child;
};

struct PointSearch {
  const SceneView& scene;
  const PointQuery& query;
  PointEntry* stack;
  std::size_t top = 0;
  double best;  // squared; candidates must not be farther
  Pace& pace;
  NearestPoint nearest{};
};

constexpr double kLargestDouble = 1.7976931348623157e308;

inline double dot3(const double* a, const double* b) noexcept { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }

// Normalizes a vector and returns its length; a vector of length 0 becomes an axis.
inline double make_unit(double* v, int axis) noexcept {
  const double length = __builtin_sqrt(dot3(v, v));
  for (int i = 0; i < 3; ++i) v[i] = length > 0.0 ? v[i] / length : (i == axis ? 1.0 : 0.0);
  return length;
}

// place: columns x, y, z and translation of a map to the world. scale: that of the tree's stored units.
inline void make_frame(PointFrame& frame, const double* place, double scale, const double* point,
                       const TreeExtent& extent) noexcept {
  const double* const columns[3] = {place, place + 3, place + 6};
  double first[3], second[3];
  for (int i = 0; i < 3; ++i) first[i] = columns[0][i], second[i] = columns[1][i];
  frame.r[0] = make_unit(first, 0);
  double along = dot3(first, second);
  for (int i = 0; i < 3; ++i) second[i] -= along * first[i];
  const double again = dot3(first, second);  // the residue left by rounding
  for (int i = 0; i < 3; ++i) second[i] -= again * first[i];
  frame.r[1] = dot3(first, columns[1]);
  frame.r[3] = make_unit(second, 1);
  double third[3];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    third[i] = first[j] * second[k] - first[k] * second[j];
  }
  frame.r[2] = dot3(first, columns[2]), frame.r[4] = dot3(second, columns[2]), frame.r[5] = dot3(third, columns[2]);
  double offset[3];
  for (int i = 0; i < 3; ++i) offset[i] = point[i] - place[9 + i];
  frame.q[0] = dot3(first, offset), frame.q[1] = dot3(second, offset), frame.q[2] = dot3(third, offset);
  double size[3] = {0.0, 0.0, 0.0};
  constexpr int kRow[6] = {0, 0, 0, 1, 1, 2}, kColumn[6] = {0, 1, 2, 1, 2, 2};
  for (int i = 0; i < 6; ++i) {
    frame.r[i] /= scale;
    const std::size_t axis = 64 * static_cast<std::size_t>(kColumn[i]);
    frame.lower_row[i] = axis + (frame.r[i] < 0.0 ? 32 : 0);
    frame.upper_row[i] = axis + (frame.r[i] < 0.0 ? 0 : 32);
    size[kRow[i]] += __builtin_fabs(frame.r[i]) * static_cast<double>(extent.largest[kColumn[i]]);
  }
  for (int i = 0; i < 3; ++i) {
    const double slack =
        0x1p-48 * (size[i] + __builtin_fabs(offset[0]) + __builtin_fabs(offset[1]) + __builtin_fabs(offset[2]));
    frame.low[i] = frame.q[i] - slack, frame.high[i] = frame.q[i] + slack;
  }
}

PERFECT_BVH_INLINE Double4 four_of(const void* row) noexcept {
  float values[4];
  __builtin_memcpy(values, row, sizeof(values));
  return Double4{values[0], values[1], values[2], values[3]};
}

// Returns the squared distance between the point and a projection on one axis.
PERFECT_BVH_INLINE Double4 gap_squared(const Double4& lower, const Double4& upper, double low, double high) noexcept {
  const Double4 none = all4(0.0), before = lower - all4(high), behind = all4(low) - upper;
  const Double4 gap = before > behind ? before : behind;
  const Double4 positive = gap > none ? gap : none;
  return positive * positive;
}

// Computes lower bounds of the children's squared distances.
PERFECT_BVH_INLINE void bound_children(const WideNode& node, const PointFrame& frame, double* squared) noexcept {
  const char* const planes = reinterpret_cast<const char*>(node.planes);
  for (std::size_t half = 0; half < 2; ++half) {
    const auto lower = [&](int i) __attribute__((always_inline)) {
      return all4(frame.r[i]) * four_of(planes + frame.lower_row[i] + 16 * half);
    };
    const auto upper = [&](int i) __attribute__((always_inline)) {
      return all4(frame.r[i]) * four_of(planes + frame.upper_row[i] + 16 * half);
    };
    const Double4 x =
        gap_squared(lower(0) + lower(1) + lower(2), upper(0) + upper(1) + upper(2), frame.low[0], frame.high[0]);
    const Double4 y = gap_squared(lower(3) + lower(4), upper(3) + upper(4), frame.low[1], frame.high[1]);
    const Double4 z = gap_squared(lower(5), upper(5), frame.low[2], frame.high[2]);
    const Double4 sum = x + y + z;
    for (std::size_t lane = 0; lane < 4; ++lane) squared[4 * half + lane] = sum[lane];
  }
}

// Returns the limit: a box with a greater lower bound is rejected.
PERFECT_BVH_INLINE double limit_of(double best) noexcept { return best * (1.0 + 0x1p-44); }

// The searched tree of the scene, at a time within the shutter.
struct PointTree {
  const WideNode* nodes;
  const WideNode* later_nodes = nullptr;  // of the next step; null at a step, for a single leaf, and without motion
  const TreeStep* step = nullptr;         // null: it does not move
  Moment moment;

  explicit PointTree(const WideNode* still) noexcept : nodes(still) {}
  PointTree(const TreeStep* steps, const Moment& at) noexcept
      : nodes(steps[at.step].nodes), step(steps + at.step), moment(at) {
    if (at.is_between()) later_nodes = step[1].nodes;
  }
};

// Pushes the children that may contain a nearer point, the farthest first.
inline void push_children(PointSearch& search, const PointFrame& frame, const WideNode& node) noexcept {
  alignas(64) double squared[8];
  bound_children(node, frame, squared);
  const double limit = limit_of(search.best);
  PointEntry* const begin = search.stack + search.top;
  PointEntry* end = begin;
  for (int lane = 0; lane < 8 && node.child[lane] != kNoChild; ++lane) {
    if (squared[lane] > limit) continue;
    PointEntry* place = end++;
    for (; place != begin && place[-1].squared < squared[lane]; --place) *place = place[-1];
    *place = {squared[lane], node.child[lane]};
  }
  search.top += static_cast<std::size_t>(end - begin);
}

__attribute__((noinline)) void push_moving_children(PointSearch& search, const PointFrame& frame, const PointTree& tree,
                                                    std::uint32_t row) noexcept {
  push_children(search, frame, node_between(tree.nodes[row], tree.later_nodes[row], tree.moment));
}

PERFECT_BVH_INLINE void push_children(PointSearch& search, const PointFrame& frame, const PointTree& tree,
                                      std::uint32_t row) noexcept {
  if (tree.later_nodes != nullptr) return push_moving_children(search, frame, tree, row);
  push_children(search, frame, tree.nodes[row]);
}

// Returns true if a triangle at the same distance replaces the nearest one: the smaller (order, id, primitive) wins.
inline bool wins_tie(const PointSearch& search, std::uint32_t instance, std::uint32_t primitive) noexcept {
  const NearestPoint& holder = search.nearest;
  if (holder.instance_index == instance) return primitive < holder.primitive_index;
  const InstanceView &first = search.scene.instances[instance], &second = search.scene.instances[holder.instance_index];
  return first.order != second.order ? first.order < second.order : first.id < second.id;
}

// Takes a primitive at this distance if it is the nearest.
PERFECT_BVH_INLINE void offer_nearest(PointSearch& search, double squared, double u, double v, std::uint32_t instance,
                                      std::uint32_t primitive) noexcept {
  if (!(squared <= search.best) || !(__builtin_sqrt(squared) <= search.query.max_distance)) return;
  if (!(squared <= kLargestDouble)) return;  // too far away for a double
  const bool is_first = search.nearest.instance_index == kNoHit;
  if (!is_first && squared == search.best && !wins_tie(search, instance, primitive)) return;
  search.best = squared;
  search.nearest = {squared, u, v, instance, primitive};
}

template <class Leaf>
void visit_triangles(PointSearch& search, const PointFrame& frame, const Leaf& leaf, std::uint32_t instance) noexcept {
  const int count = leaf.primitives[3] == leaf.primitives[7] ? 4 : 8;
  for (int first = 0; first < count; first += 4) {
    Vectors4 corners[3];
    for (int corner = 0; corner < 3; ++corner) {
      Double4 p[3];
      for (int lane = 0; lane < 4; ++lane) {
        for (int axis = 0; axis < 3; ++axis) {
          p[axis][lane] = static_cast<double>(coordinate(leaf, first + lane, corner, axis));
        }
      }
      const double* const r = frame.r;
      corners[corner].x = all4(r[0]) * p[0] + all4(r[1]) * p[1] + all4(r[2]) * p[2] - all4(frame.q[0]);
      corners[corner].y = all4(r[3]) * p[1] + all4(r[4]) * p[2] - all4(frame.q[1]);
      corners[corner].z = all4(r[5]) * p[2] - all4(frame.q[2]);
    }
    const NearestOnTriangles found = nearest_to_origin(corners[0], corners[1], corners[2]);
    for (int lane = 0; lane < 4; ++lane) {
      offer_nearest(search, found.squared[lane], found.u[lane], found.v[lane], instance, leaf.primitives[first + lane]);
    }
  }
}

// An instance of curves or points: its placement, and the query point relative to its origin.
struct RoundFrame {
  RoundPlace place;
  double query[3];

  RoundFrame(const double* columns, const double* point) noexcept : place(round_place(columns)) {
    for (int i = 0; i < 3; ++i) query[i] = point[i] - columns[9 + i];
  }
};

// Visits a leaf of curves or points. Each is solid: if the query point is inside, it is the nearest point itself.
__attribute__((noinline)) void visit_rounds(PointSearch& search, const RoundFrame& frame, const RoundLeaves& leaves,
                                            std::uint32_t index, std::uint32_t row) noexcept {
  RoundList list = leaves.round;
  list.scale = 1.0f;
  const std::uint32_t* const primitives = leaves.primitives(row);
  for (int lane = 0; lane < 8; ++lane) {
    if (lane > 0 && primitives[lane] == primitives[lane - 1]) continue;
    const NearestOnRound found = nearest_on_round(frame.place, ends_of(list, primitives[lane]), frame.query);
    offer_nearest(search, found.squared, found.u, 0.0, index, primitives[lane]);
  }
}

// Visits a leaf of triangles of a moving tree.
__attribute__((noinline)) void visit_moving_triangles(PointSearch& search, const PointFrame& frame,
                                                      const PointTree& tree, std::uint32_t row,
                                                      std::uint32_t index) noexcept {
  const InstanceView& instance = search.scene.instances[index];
  if (!tree.moment.is_between()) return visit_triangles(search, frame, tree.step->leaves.blocks[row], index);
  visit_triangles(search, frame, MovingBlock(tree.step, tree.moment, row, span_slack(instance)), index);
}

// Returns columns x, y, z and translation of the map to the world: the scene's row, or the present one of a turning
// instance.
inline const double* place_of(const SceneView& scene, std::uint32_t index, float time, double* turned) noexcept {
  const InstanceView& instance = scene.instances[index];
  if (instance.motion != 0) {
    const MotionView& motion = scene.motions[instance.motion - 1];
    if (motion.turns != nullptr) {
      TurnedPlace place;
      place_between(motion.turns, moment_at(motion.turn_times, time), place);
      const double *const c = place.columns, *const o = motion.centre;
      for (int i = 0; i < 9; ++i) turned[i] = c[i];
      for (int i = 0; i < 3; ++i)
        turned[9 + i] = ((c[i] * o[0] + c[3 + i] * o[1]) + c[6 + i] * o[2]) + place.translation[i];
      return turned;
    }
  }
  return reinterpret_cast<const double*>(reinterpret_cast<const char*>(scene.places) + index * scene.place_stride);
}

inline PointTree tree_of(const SceneView& scene, const InstanceView& instance, float time) noexcept {
  if (instance.motion == 0) return PointTree(instance.nodes);
  const MotionView& motion = scene.motions[instance.motion - 1];
  if (motion.trees == nullptr) return PointTree(instance.nodes);
  return {motion.trees, moment_at(motion.tree_times, time)};
}

// Searches everything below `root` that may contain a nearer point.
inline void search_instance(PointSearch& search, std::uint32_t index) noexcept {
  const InstanceView& instance = search.scene.instances[index];
  if ((instance.mask & search.query.mask) == 0) return;
  double turned[12];
  const double* const place = place_of(search.scene, index, search.query.time, turned);
  const PointTree tree = tree_of(search.scene, instance, search.query.time);
  PointFrame frame;
  make_frame(frame, place, static_cast<double>(instance.scale), search.query.position, instance.extent);
  const LeafBlock* const blocks = blocks_of(instance);
  const std::size_t bottom = search.top;
  search.stack[search.top++] = {0.0, instance.root};
  while (search.top > bottom) {
    const PointEntry entry = search.stack[--search.top];
    if (entry.squared > limit_of(search.best)) continue;
    if (entry.child < kBlockChild) {
      push_children(search, frame, tree, entry.child);
    } else if (search.pace.should_stop()) {
      search.top = 0;
      return;
    } else if (const std::uint32_t row = entry.child - kBlockChild; blocks != nullptr) {
      if (tree.step != nullptr) {
        visit_moving_triangles(search, frame, tree, row, index);
      } else {
        visit_triangles(search, frame, blocks[row], index);
      }
    } else {
      const RoundFrame round(place, search.query.position);
      const bool moves = tree.step != nullptr;
      visit_rounds(search, round, moves ? moving_leaves(tree.step, tree.moment) : *instance.leaves.round_leaves, index,
                   row);
    }
  }
}

inline void search_scene(PointSearch& search) noexcept {
  constexpr double kWorld[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  const SceneView& scene = search.scene;
  PointFrame frame;
  make_frame(frame, kWorld, static_cast<double>(scene.scale), search.query.position, scene.extent);
  const PointTree tree = scene.motions == nullptr
                             ? PointTree(scene.nodes)
                             : PointTree(scene.top_steps, moment_at(scene.top_times, search.query.time));
  search.stack[search.top++] = {0.0, scene.root};
  while (search.top > 0) {
    const PointEntry entry = search.stack[--search.top];
    if (entry.squared > limit_of(search.best)) continue;
    if (entry.child < kInstanceChild) {
      push_children(search, frame, tree, entry.child);
    } else if (search.pace.should_stop()) {
      return;
    } else {
      search_instance(search, entry.child - kInstanceChild);
    }
  }
}

inline bool is_valid_query(const PointQuery& query) noexcept {
  const double* const p = query.position;
  const double zero = p[0] * 0.0 + p[1] * 0.0 + p[2] * 0.0;  // NaN if one is not finite
  return zero == 0.0 && query.max_distance >= 0.0 && is_in_shutter(query.time);
}

std::size_t point_workspace_bytes(const SceneView& scene) {
  return (std::size_t{scene.stack_entries} + 8) * sizeof(PointEntry);
}

void find_closest_points(const SceneView& scene, const PointQuery* queries, std::size_t count, NearestPoint* nearest,
                         void* workspace) {
  Pace pace(scene.interruption);
  for (std::size_t i = 0; i < count; ++i) {
    const double farthest = queries[i].max_distance;
    PointSearch search{scene, queries[i], static_cast<PointEntry*>(workspace), 0, limit_of(farthest * farthest), pace};
    search.nearest = {0.0, 0.0, 0.0, kNoHit, kNoHit};
    if (!scene.is_empty && is_valid_query(queries[i])) search_scene(search);
    nearest[i] = search.nearest;
  }
}

}  // namespace
}  // namespace perfect_bvh
