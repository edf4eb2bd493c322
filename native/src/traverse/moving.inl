// What moves within the shutter, at a ray's time: where an instance stands, and a tree between two of its steps.
// Part of stream_kernel.inl: everything has internal linkage.

// The map from the scene's scale to that of the tree, as an InstanceView's. False where it has none: the instance is
// flattened at that moment, and no ray meets it.
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
  return size <= kLargestFloat;  // NaN is not
}

// Takes the ray to where a turning instance is by its steps: there its stretch changes. False if the ray does not see
// it.
__attribute__((noinline)) bool map_to_step(Slot& slot, const MotionView& motion, const Moment& moment,
                                           double tree_scale, double world_scale) noexcept {
  TurnedPlace place;
  place_between(motion.turns, moment, place);
  alignas(32) double map[4][4];
  if (!invert_place(map, place, motion.centre, tree_scale, world_scale, slot.is_mirrored)) return false;
  map_to_local(slot.local, slot.world, map);
  return true;
}

// Takes the ray to a moving instance's frame. False if the ray does not see it.
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

// The tree of the slot's instance, or the top level, is that of a moment.
inline void take_step(Slot& slot, const TreeStep* steps, const Moment& moment) noexcept {
  slot.step = steps + moment.step;
  slot.moment = moment;
  slot.nodes = slot.step->nodes;
  slot.later_nodes = moment.is_between() ? slot.step[1].nodes : nullptr;
}

inline void take_top_step(Slot& slot, const SceneView& scene) noexcept {
  take_step(slot, scene.top_steps, slot.top_moment);
}

// By how much less than this vertices are rounded where they are interpolated: a part of how far away from the origin
// they are.
inline float span_slack(const InstanceView& instance) noexcept { return instance.extent.reach * 0x1p-20f; }

inline void take_tree_step(Slot& slot, const SceneView& scene, const InstanceView& instance, float time) noexcept {
  slot.step = nullptr, slot.later_nodes = nullptr;
  if (instance.motion == 0) return;
  const MotionView& motion = scene.motions[instance.motion - 1];
  if (motion.trees == nullptr) return;
  take_step(slot, motion.trees, moment_at(motion.tree_times, time));
  if (instance.is_round == 0) slot.blocks = slot.step->blocks;
  slot.span_slack = span_slack(instance);
}
