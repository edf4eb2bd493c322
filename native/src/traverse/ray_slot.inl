// One ray under way in a stream: its constants, its limits, its best hit so far, and its stack.
// Part of stream_kernel.inl: everything has internal linkage.

// What node visits read: one cache line.
struct BoxState {
  SlabRay slab;
  float t_min, t_limit;                   // local; the limit sinks as hits are found
  std::uint16_t near_row[3], far_row[3];  // byte offsets of the planes in a node
  std::uint32_t order_shift;              // 3 * octant
};
static_assert(sizeof(BoxState) == 60);

// Stack entries are children (see wide_bvh.h) or marks. Entry 0 is always kDoneMark.
constexpr std::uint32_t kLeaveMark = kFirstMark;  // back from an instance to the top level
constexpr std::uint32_t kDoneMark = 0xFFFFFFFFu;

struct alignas(64) Slot {
  BoxState box;
  std::uint32_t top;  // the stack's highest entry: what to visit next

  const WideNode* nodes;
  const LeafBlock* blocks;
  TriangleRay triangle;
  std::uint16_t row[4];    // byte offsets in a leaf block of the sheared frame's x, y and z
  std::uint32_t ray;       // row in the batch
  std::uint32_t instance;  // being traversed; row in the scene

  double best_t;  // in the ray's own terms
  float u, v;
  std::uint32_t hit_instance, hit_primitive;  // kNoHit: none yet
  TimeFrame time;                             // of the level being traversed
  std::uint32_t floor;                        // the highest entry that does not belong to that level

  ObjectRay world;  // as the top level sees it
  BoxState world_box;
};

inline std::uint32_t* stack_of(Slot& slot) noexcept { return reinterpret_cast<std::uint32_t*>(&slot + 1); }

inline void set_box(BoxState& box, const float origin[3], const float direction[3], int longest,
                    const TreeExtent& extent) noexcept {
  set_slab_ray(box.slab, origin, direction, longest, extent);
  std::uint32_t octant = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t runs_down = box.slab.inverse[axis] < 0.0f ? 1u : 0u;
    const std::uint32_t row = 64u * static_cast<std::uint32_t>(axis);
    box.near_row[axis] = static_cast<std::uint16_t>(row + 32 * runs_down);
    box.far_row[axis] = static_cast<std::uint16_t>(row + 32 - 32 * runs_down);
    octant |= runs_down << axis;
  }
  box.order_shift = 3 * octant;
}

// Drops the entries of this level that begin beyond the limit.
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

// Takes on a new ray. False if it can hit nothing.
inline bool start_ray(Slot& slot, const SceneView& scene, const Ray& ray) noexcept {
  const double* const origin = &ray.origin.x;
  const double* const direction = &ray.direction.x;
  // Sums that are finite only if every part is; NaN and infinity spread.
  if (!__builtin_isfinite((origin[0] - origin[0]) + (origin[1] - origin[1]) + (origin[2] - origin[2])) ||
      !(ray.t_min <= ray.t_max)) {
    return false;
  }
  const double scale = static_cast<double>(scene.scale);
  for (int axis = 0; axis < 3; ++axis) {
    slot.world.origin[axis] = origin[axis] * scale;
    slot.world.direction[axis] = direction[axis] * scale;
  }
  slot.world.time = {0.0, 1.0, true};
  if (!bring_near(slot.world, static_cast<double>(scene.extent.reach))) return false;
  slot.best_t = static_cast<double>(ray.t_max);
  slot.u = slot.v = 0.0f;
  slot.hit_instance = slot.hit_primitive = kNoHit;
  slot.time = slot.world.time;
  slot.floor = 0;
  slot.top = 1;
  std::uint32_t* const stack = stack_of(slot);
  stack[0] = kDoneMark;
  stack[1] = scene.root;
  if (scene.root >= kInstanceChild) return true;  // a single instance: the top level has no boxes
  float narrow_origin[3], narrow_direction[3];
  narrow(slot.world.origin, narrow_origin);
  narrow(slot.world.direction, narrow_direction);
  slot.nodes = scene.nodes;
  set_box(slot.box, narrow_origin, narrow_direction, longest_axis(narrow_direction), scene.extent);
  slot.box.t_min = to_local_min(slot.time, static_cast<double>(ray.t_min));
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  slot.world_box = slot.box;
  return true;
}

// The instance on top of the stack gives way to the root of its tree. False if the ray does not see it.
inline bool enter_instance(Slot& slot, const SceneView& scene, const Ray& ray) noexcept {
  std::uint32_t* const stack = stack_of(slot);
  slot.instance = stack[slot.top] - kInstanceChild;
  const InstanceView& instance = scene.instances[slot.instance];
  if ((instance.mask & ray.mask) == 0) return false;
  ObjectRay local;
  map_ray(local, slot.world, instance.world_to_local);
  if (!bring_near(local, static_cast<double>(instance.extent.reach))) return false;
  float origin[3], direction[3];
  narrow(local.origin, origin);
  narrow(local.direction, direction);
  const int longest = longest_axis(direction);
  slot.time = local.time;
  slot.nodes = instance.nodes;
  slot.blocks = instance.blocks;
  set_box(slot.box, origin, direction, longest, instance.extent);
  set_triangle_ray(slot.triangle, origin, direction, longest, instance.extent);
  for (int i = 0; i < 3; ++i) slot.row[i] = static_cast<std::uint16_t>(32 * slot.triangle.axes[i]);
  slot.box.t_min = to_local_min(slot.time, static_cast<double>(ray.t_min));
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  if (slot.top == 1) {  // nothing to come back to
    slot.floor = 0;
  } else {
    stack[slot.top] = kLeaveMark;
    slot.floor = slot.top++;
  }
  stack[slot.top] = instance.root;
  return true;
}

// Any-hit rays stop at their first hit: their limit never sinks, and no entry distances are stacked.
template <bool kAny>
inline void leave_instance(Slot& slot, const SceneView& scene, std::size_t nears_offset) noexcept {
  slot.box = slot.world_box;
  slot.time = slot.world.time;
  slot.box.t_limit = to_local_max(slot.time, slot.best_t);
  slot.nodes = scene.nodes;
  slot.floor = 0;
  --slot.top;
  if constexpr (!kAny) drop_far_entries(slot, nears_offset);
}
