// The state of one ray in flight in a stream: its constants, its limits, its best hit yet, and its stack.
// Part of stream_kernel.inl: everything has internal linkage.

// Stack entries are children (see wide_bvh.h) or marks. Entry 0 is always kDoneMark.
constexpr std::uint32_t kLeaveMark = kFirstMark;  // back from an instance to the top level
constexpr std::uint32_t kDoneMark = 0xFFFFFFFFu;

struct alignas(64) Slot {
  BoxState box;
  std::uint32_t top;  // the stack's highest entry: the next to visit

  TriangleState triangle;
  std::uint32_t ray;                          // row in the batch
  std::uint32_t hit_instance, hit_primitive;  // kNoHit: none yet; with u and v as in a Hit

  TimeFrame time;  // of the level being traversed
  float u, v;
  const WideNode* nodes;
  const LeafBlock* blocks;  // null: the tree is over curves or points
  double best_t;            // in the ray's own terms; last_t(t_max) before the first hit
  std::uint32_t instance;   // being traversed; row in the scene
  std::uint32_t floor;      // the highest entry that belongs to the level above

  ObjectRay local;  // in the frame of the tree being traversed
  // The ray that instances map, and the top level's constants. Not used by a lone instance that is traced directly.
  ObjectRay world;  // the given ray, times the scene's scale
  TimeFrame world_time;
  BoxState world_box;
  bool is_mirrored;  // the instance's transform reverses the winding

  // Describes the tree being traversed, in a scene where anything moves within the shutter.
  const TreeStep* step;         // null: it does not move
  const WideNode* later_nodes;  // of the next step; null if the tree is at a step or a single leaf
  Moment moment, top_moment;    // of that tree, and of the top level
  float span_slack;
};

inline std::uint32_t* stack_of(Slot& slot) noexcept { return reinterpret_cast<std::uint32_t*>(&slot + 1); }

// Drops the entries of this level that the ray enters beyond the limit.
inline void drop_far_entries(Slot& slot, std::size_t nears_offset) noexcept {
  std::uint32_t* const children = stack_of(slot);
  float* const nears = reinterpret_cast<float*>(children + nears_offset);
  const Float8 limit = broadcast(slot.box.t_limit);
  std::uint32_t kept = slot.floor + 1;
  for (std::uint32_t i = kept; i <= slot.top; i += 8) {
    const std::uint32_t left = slot.top - i + 1;
    kept += keep_near(children + i, nears + i, left < 8 ? left : 8, limit, children + kept, nears + kept);
  }
  slot.top = kept - 1;
}

// Excludes everything beyond the best hit from the range. For a tree, not for the top level.
inline void set_limit(Slot& slot) noexcept {
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  set_depths(slot.triangle, slot.box.t_min, slot.box.t_limit);
}

// Returns null if the instance is over curves or points.
inline const LeafBlock* blocks_of(const InstanceView& instance) noexcept {
  return instance.is_round != 0 ? nullptr : instance.leaves.blocks;
}

// Resets the slot to no hit.
inline void clear_hit(Slot& slot) noexcept {
  slot.u = slot.v = 0.0f;
  slot.hit_instance = slot.hit_primitive = kNoHit;
}

// A ray that moves ----------------------------------------------------------------------------------------------------
// Motion within the shutter, at a ray's time: the placement of an instance, and a tree between two of its steps.
// Part of stream_kernel.inl: everything has internal linkage.

// Computes the map from the scene's scale to the tree's, as in an InstanceView. Returns false if there is none: the
// instance is flat at that moment, and no ray hits it.
inline bool invert_place(double (*map)[4], const TurnedPlace& place, const double* centre, double tree_scale,
                         double world_scale, bool& is_mirrored) noexcept {
  const double* const c = place.columns;
  double rows[3][3];
  for (int row = 0; row < 3; ++row) {
    const double *const u = c + 3 * ((row + 1) % 3), *const v = c + 3 * ((row + 2) % 3);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      rows[row][i] = u[j] * v[k] - u[k] * v[j];
    }
  }
  const double determinant = (c[0] * rows[0][0] + c[1] * rows[0][1]) + c[2] * rows[0][2];
  is_mirrored = determinant < 0.0;
  const double over = 1.0 / determinant, in_tree = tree_scale / world_scale;
  double size = 0.0;
  for (int row = 0; row < 3; ++row) {
    double moved = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double entry = rows[row][i] * over;
      moved += entry * place.translation[i];
      map[i][row] = entry * in_tree;
      size += __builtin_fabs(map[i][row]);
    }
    map[3][row] = -(moved + centre[row]) * tree_scale;
    size += __builtin_fabs(map[3][row]);
  }
  for (int column = 0; column < 4; ++column) map[column][3] = 0.0;
  constexpr double kLargestFloat = 3.4028234e38;
  return size <= kLargestFloat;  // false for NaN
}

// Maps the ray to a turning instance whose stretch changes, interpolating between its steps. Returns false if the ray
// does not see it.
__attribute__((noinline)) bool map_to_step(Slot& slot, const MotionView& motion, const Moment& moment,
                                           double tree_scale, double world_scale) noexcept {
  TurnedPlace place;
  place_between(motion.turns, moment, place);
  alignas(32) double map[4][4];
  if (!invert_place(map, place, motion.centre, tree_scale, world_scale, slot.is_mirrored)) return false;
  map_to_local(slot.local, slot.world, map);
  return true;
}

// Maps the ray to a moving instance's frame. Returns false if the ray does not see it.
inline bool map_to_moving(Slot& slot, const SceneView& scene, const InstanceView& instance, float time) noexcept {
  const MotionView& motion = scene.motions[instance.motion - 1];
  if (motion.backs == nullptr) {
    map_to_local(slot.local, slot.world, instance.world_to_local);
    return true;
  }
  const Moment moment = moment_at(motion.turn_times, time);
  const double tree_scale = static_cast<double>(instance.scale), world_scale = static_cast<double>(scene.scale);
  const TurnBack& back = motion.backs[moment.step];
  if (back.is_ready == 0) return map_to_step(slot, motion, moment, tree_scale, world_scale);
  slot.is_mirrored = back.is_mirrored != 0;
  turn_ray_back(back, static_cast<double>(moment.later), motion.centre, tree_scale, world_scale, slot.world.origin,
                slot.world.direction, slot.local.origin, slot.local.direction);
  slot.local.time = slot.world.time;
  return true;
}

// Sets the slot's tree (of its instance, or the top level) to that of a moment.
inline void take_step(Slot& slot, const TreeStep* steps, const Moment& moment) noexcept {
  slot.step = steps + moment.step;
  slot.moment = moment;
  slot.nodes = slot.step->nodes;
  slot.later_nodes = moment.is_between() ? slot.step[1].nodes : nullptr;
}

inline void take_top_step(Slot& slot, const SceneView& scene) noexcept {
  take_step(slot, scene.top_steps, slot.top_moment);
}

// Returns a bound of the rounding of interpolated vertices: a fraction of their distance from the origin.
inline float span_slack(const InstanceView& instance) noexcept { return instance.extent.reach * 0x1p-20f; }

inline void take_tree_step(Slot& slot, const SceneView& scene, const InstanceView& instance, float time) noexcept {
  slot.step = nullptr, slot.later_nodes = nullptr;
  if (instance.motion == 0) return;
  const MotionView& motion = scene.motions[instance.motion - 1];
  if (motion.trees == nullptr) return;
  take_step(slot, motion.trees, moment_at(motion.tree_times, time));
  if (slot.blocks != nullptr) slot.blocks = slot.step->leaves.blocks;
  slot.span_slack = span_slack(instance);
}

// Starts a new ray. Returns false if it can hit nothing. kMoves: the scene has motions.
template <bool kMoves>
__attribute__((noinline)) bool start_ray(Slot& slot, const SceneView& scene, const Ray& ray) noexcept {
  if (!(ray.t_min <= ray.t_max)) return false;
  if (kMoves && !is_in_shutter(ray.time)) return false;
  if (!load_ray(slot.world, ray, static_cast<double>(scene.scale))) return false;
  const double reach = static_cast<double>(scene.reach);
  const ObjectRay* near = &slot.world;
  if (!stands_near(slot.world, reach)) [[unlikely]] {
    slot.local = slot.world;  // the first instance entered sets it again
    if (!bring_near(slot.local, reach)) return false;
    near = &slot.local;
  }
  slot.best_t = last_t(ray.t_max);
  clear_hit(slot);
  slot.instance = kNoHit, slot.floor = 0;
  slot.top = 1;
  std::uint32_t* const stack = stack_of(slot);
  stack[0] = kDoneMark;
  stack[1] = scene.root;
  if (scene.root >= kInstanceChild) return true;  // a single instance: the top level has no boxes
  slot.time = slot.world_time = near->time;
  slot.nodes = scene.nodes;
  if constexpr (kMoves) {
    slot.top_moment = moment_at(scene.top_times, ray.time);
    take_top_step(slot, scene);
  }
  set_states(slot.box, slot.triangle, *near, scene.extent);
  slot.box.t_min = to_local_min(slot.time, static_cast<double>(ray.t_min));
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  slot.world_box = slot.box;
  return true;
}

// Replaces the instance on top of the stack with the root of its tree. Returns false if the ray does not see it: the
// caller then drops the entry.
template <bool kMoves>
inline bool enter_instance(Slot& slot, const SceneView& scene, const Ray& ray) noexcept {
  std::uint32_t* const stack = stack_of(slot);
  const std::uint32_t index = stack[slot.top] - kInstanceChild;
  const InstanceView& instance = scene.instances[index];
  const bool is_in_place = slot.instance == index;  // with constants from start_eight()
  slot.instance = index;
  if ((instance.mask & ray.mask) == 0) return false;
  ObjectRay& local = slot.local;
  slot.is_mirrored = instance.mirrored != 0;
  if (is_in_place) {
    local = slot.world;
  } else if (!kMoves || instance.motion == 0) {
    map_to_local(local, slot.world, instance.world_to_local);
  } else if (!map_to_moving(slot, scene, instance, ray.time)) {
    return false;
  }
  const double reach = static_cast<double>(instance.extent.reach);
  if (!is_in_place && !stands_near(local, reach) && !bring_near(local, reach)) return false;
  slot.time = local.time;
  slot.nodes = instance.nodes;
  slot.blocks = blocks_of(instance);
  if constexpr (kMoves) take_tree_step(slot, scene, instance, ray.time);
  if (!is_in_place) {
    set_states(slot.box, slot.triangle, local, instance.extent);
    slot.box.t_min = to_local_min(slot.time, static_cast<double>(ray.t_min));
  }
  set_limit(slot);
  if (slot.top == 1) {  // nothing to return to
    slot.floor = 0;
  } else {
    stack[slot.top] = kLeaveMark;
    slot.floor = slot.top++;
  }
  stack[slot.top] = instance.root;
  return true;
}

// Returns the scene's only instance, if it is in place (SceneView): most rays need no mapping then, and keep no state
// for a top level. Null: rays take the usual path.
inline const InstanceView* lone_instance(const SceneView& scene) noexcept {
  return scene.root >= kInstanceChild ? scene.in_place : nullptr;
}

// Origins up to here, on any axis, are near the scene and its instance in place. 0: there is none.
inline double farthest_in_place(const SceneView& scene) noexcept {
  const float reach = scene.in_place != nullptr ? scene.in_place->extent.reach : 0.0f;
  return kNearby * static_cast<double>(smaller(scene.reach, reach));
}

// Sets everything that is the same for all rays traced directly.
inline void prepare_slot(Slot& slot, const SceneView& scene, const InstanceView& instance) noexcept {
  stack_of(slot)[0] = kDoneMark;
  slot.instance = scene.root - kInstanceChild;
  slot.is_mirrored = instance.mirrored != 0;
  slot.nodes = instance.nodes;
  slot.blocks = blocks_of(instance);
  slot.floor = 0;
}

// Does start_ray() and enter_instance() at once, with the same result. Returns false if the ray is not a usual one: it
// must then be started the usual way.
template <bool kMoves>
PERFECT_BVH_INLINE bool start_directly(Slot& slot, const SceneView& scene, const Ray& ray) noexcept {
  const InstanceView& instance = *scene.in_place;
  if (!(ray.t_min <= ray.t_max) || (instance.mask & ray.mask) == 0) return false;
  if (kMoves && !is_in_shutter(ray.time)) return false;
  if (!load_near(slot.local, ray, static_cast<double>(scene.scale), farthest_in_place(scene))) return false;
  if constexpr (kMoves) take_tree_step(slot, scene, instance, ray.time);
  set_states(slot.box, slot.triangle, slot.local, instance.extent);
  slot.best_t = last_t(ray.t_max);
  slot.time = slot.local.time;
  slot.box.t_min = ray.t_min;
  set_limit(slot);
  clear_hit(slot);
  slot.top = 1;
  stack_of(slot)[1] = instance.root;
  return true;
}

// Any-hit rays stop at their first hit: their limit never decreases, and their stacks hold no entry distances.
template <bool kAny, bool kMoves>
inline void leave_instance(Slot& slot, const SceneView& scene, std::size_t nears_offset) noexcept {
  slot.box = slot.world_box;
  slot.time = slot.world_time;
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  slot.nodes = scene.nodes;
  if constexpr (kMoves) take_top_step(slot, scene);
  slot.floor = 0;
  --slot.top;
  if constexpr (!kAny) drop_far_entries(slot, nears_offset);
}
