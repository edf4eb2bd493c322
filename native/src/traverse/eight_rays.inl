// Starts eight rays of a stream in their slots at once: start_directly() or start_ray(), a vector of rays at a time,
// with the same bits. A ray alone takes some 150 instructions for that, here 85. (Instances are entered one ray at a
// time: eight at once took 206 instructions each, no fewer, and 5 to 12 % longer.)
// Part of stream_kernel.inl, for the instruction sets of isa_avx.h: everything has internal linkage.

// One quantity of eight rays along each axis.
struct EightVectors {
  __m256 x, y, z;
};

PERFECT_BVH_INLINE __m256 pick(const EightVectors& v, __m256 is_x, __m256 is_y) noexcept {
  return _mm256_blendv_ps(_mm256_blendv_ps(v.z, v.y, is_y), v.x, is_x);
}
PERFECT_BVH_INLINE __m256 as_float(std::uint32_t word) noexcept {
  return _mm256_castsi256_ps(_mm256_set1_epi32(static_cast<int>(word)));
}
PERFECT_BVH_INLINE __m256 size_of(__m256 a) noexcept { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a); }
PERFECT_BVH_INLINE EightVectors sizes_of(const EightVectors& v) noexcept {
  return {size_of(v.x), size_of(v.y), size_of(v.z)};
}
PERFECT_BVH_INLINE __m256 largest_of(const EightVectors& v) noexcept {
  return _mm256_max_ps(_mm256_max_ps(v.x, v.y), v.z);
}

// Transposes eight vectors of four into columns; returns the fourth separately, if it is requested.
PERFECT_BVH_INLINE EightVectors turn_columns(const __m128 (&rows)[kEight], __m256* fourth = nullptr) noexcept {
  __m256 pairs[4];
  for (int i = 0; i < 4; ++i) pairs[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(rows[i]), rows[i + 4], 1);
  const __m256 low = _mm256_unpacklo_ps(pairs[0], pairs[1]), high = _mm256_unpacklo_ps(pairs[2], pairs[3]);
  const __m256 low_z = _mm256_unpackhi_ps(pairs[0], pairs[1]), high_z = _mm256_unpackhi_ps(pairs[2], pairs[3]);
  if (fourth != nullptr) *fourth = _mm256_shuffle_ps(low_z, high_z, 0xEE);
  return {_mm256_shuffle_ps(low, high, 0x44), _mm256_shuffle_ps(low, high, 0xEE),
          _mm256_shuffle_ps(low_z, high_z, 0x44)};
}

// Stores column i at byte `offset` of slot i.
PERFECT_BVH_INLINE void store_rows(Slot* const* slots, std::size_t offset, const __m256 (&columns)[kEight]) noexcept {
  __m256 pairs[8], fours[8];
  for (int i = 0; i < 8; i += 2) {
    pairs[i] = _mm256_unpacklo_ps(columns[i], columns[i + 1]);
    pairs[i + 1] = _mm256_unpackhi_ps(columns[i], columns[i + 1]);
  }
  for (int i = 0; i < 8; i += 4) {
    fours[i] = _mm256_shuffle_ps(pairs[i], pairs[i + 2], 0x44);
    fours[i + 1] = _mm256_shuffle_ps(pairs[i], pairs[i + 2], 0xEE);
    fours[i + 2] = _mm256_shuffle_ps(pairs[i + 1], pairs[i + 3], 0x44);
    fours[i + 3] = _mm256_shuffle_ps(pairs[i + 1], pairs[i + 3], 0xEE);
  }
  const auto at = [&](int i) __attribute__((always_inline)) {
    return reinterpret_cast<float*>(reinterpret_cast<char*>(slots[i]) + offset);
  };
  for (int i = 0; i < 4; ++i) {
    _mm256_store_ps(at(i), _mm256_permute2f128_ps(fours[i], fours[i + 4], 0x20));
    _mm256_store_ps(at(i + 4), _mm256_permute2f128_ps(fours[i], fours[i + 4], 0x31));
  }
}

// The data from which set_states() makes the constants of a level.
struct EightRays {
  EightVectors origin, direction;
  EightVectors away, length;  // their absolute values
  __m256 t_min, t_limit;

  PERFECT_BVH_INLINE void set(const EightVectors& from, const EightVectors& along) noexcept {
    origin = from, direction = along, away = sizes_of(from), length = sizes_of(along);
  }
};

// Computes OctantRows, as four words.
PERFECT_BVH_INLINE void octant_rows(const EightVectors& inverse, __m256* words) noexcept {
  static_assert(sizeof(OctantRows) == 16 && kOctantRows[1].near_row[0] == 32 && kOctantRows[1].order_shift == 3);
  const auto down = [](__m256 v) __attribute__((always_inline)) {  // 32 where it runs down
    return _mm256_and_si256(_mm256_srli_epi32(_mm256_castps_si256(v), 26), _mm256_set1_epi32(32));
  };
  const __m256i x = down(inverse.x), y = down(inverse.y), z = down(inverse.z);
  const auto high = [](__m256i v) __attribute__((always_inline)) { return _mm256_slli_epi32(v, 16); };
  const auto pair = [](int low_row, int high_row)
                        __attribute__((always_inline)) { return _mm256_set1_epi32(low_row + (high_row << 16)); };
  words[0] = _mm256_castsi256_ps(_mm256_add_epi32(_mm256_add_epi32(pair(0, 64), x), high(y)));
  words[1] = _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_add_epi32(pair(128, 32), z), high(x)));
  words[2] = _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_sub_epi32(pair(96, 160), y), high(z)));
  const __m256i octant =
      _mm256_srli_epi32(_mm256_add_epi32(x, _mm256_add_epi32(_mm256_slli_epi32(y, 1), _mm256_slli_epi32(z, 2))), 5);
  words[3] = _mm256_castsi256_ps(_mm256_add_epi32(octant, _mm256_add_epi32(octant, octant)));
}

PERFECT_BVH_INLINE EightVectors vectors_of(const TreeExtent& extent) noexcept {
  return {_mm256_set1_ps(extent.largest[0]), _mm256_set1_ps(extent.largest[1]), _mm256_set1_ps(extent.largest[2])};
}

PERFECT_BVH_INLINE EightVectors sum_of(const EightVectors& a, const EightVectors& b) noexcept {
  return {_mm256_add_ps(a.x, b.x), _mm256_add_ps(a.y, b.y), _mm256_add_ps(a.z, b.z)};
}

// Does set_states(), set_depths() and clear_hit() for eight slots whose stacks have one entry, and sets `ray`. `boxes`
// is the extent of all boxes that will be tested; only `tree` has triangles.
PERFECT_BVH_INLINE void set_eight(Slot* const* slots, const EightRays& rays, const TreeExtent& boxes,
                                  const TreeExtent& tree, const std::uint32_t* ray_rows) noexcept {
  const __m256 sign_bit = _mm256_set1_ps(-0.0f);
  const EightVectors &origin = rays.origin, &direction = rays.direction, &length = rays.length;
  const __m256 x_over_y = _mm256_cmp_ps(length.x, length.y, _CMP_GT_OQ);
  const __m256 is_x = _mm256_and_ps(x_over_y, _mm256_cmp_ps(length.x, length.z, _CMP_GT_OQ));
  const __m256 is_y = _mm256_andnot_ps(x_over_y, _mm256_cmp_ps(length.y, length.z, _CMP_GT_OQ));
  const __m256 smallest = _mm256_mul_ps(_mm256_set1_ps(kSmallestShare), largest_of(length));
  const auto invert = [&](__m256 component, __m256 its_length) __attribute__((always_inline)) {
    const __m256 raised = _mm256_or_ps(_mm256_max_ps(its_length, smallest), _mm256_and_ps(sign_bit, component));
    return _mm256_div_ps(_mm256_set1_ps(1.0f), raised);
  };
  const EightVectors inverse{invert(direction.x, length.x), invert(direction.y, length.y),
                             invert(direction.z, length.z)};
  const EightVectors reach = sum_of(vectors_of(boxes), rays.away);
  const __m256 long_inverse = pick(inverse, is_x, is_y), long_reach = pick(reach, is_x, is_y);
  const __m256 long_depth = _mm256_mul_ps(long_reach, size_of(long_inverse));
  const __m256 share = _mm256_mul_ps(_mm256_set1_ps(kReachShare), long_reach);
  const __m256 depth_slack = _mm256_mul_ps(_mm256_set1_ps(kDepthSlack), long_depth);
  const auto slack = [&](__m256 its_reach, __m256 its_inverse) __attribute__((always_inline)) {
    const __m256 across = _mm256_mul_ps(_mm256_add_ps(its_reach, share), size_of(its_inverse));
    return _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(kPlaneSlack), across), depth_slack);
  };
  const __m256 at_x = _mm256_mul_ps(origin.x, inverse.x), slack_x = slack(reach.x, inverse.x);
  const __m256 at_y = _mm256_mul_ps(origin.y, inverse.y), slack_y = slack(reach.y, inverse.y);
  const __m256 at_z = _mm256_mul_ps(origin.z, inverse.z), slack_z = slack(reach.z, inverse.z);
  __m256 rows[4];
  octant_rows(inverse, rows);
  static_assert(offsetof(Slot, box) == 0 && offsetof(SlabRay, far_offset) == 24 && offsetof(BoxState, rows) == 36 &&
                offsetof(BoxState, t_min) == 52 && offsetof(BoxState, t_limit) == 56 && offsetof(Slot, top) == 60);
  const __m256 first[kEight] = {inverse.x,
                                inverse.y,
                                inverse.z,
                                _mm256_add_ps(at_x, slack_x),
                                _mm256_add_ps(at_y, slack_y),
                                _mm256_add_ps(at_z, slack_z),
                                _mm256_sub_ps(at_x, slack_x),
                                _mm256_sub_ps(at_y, slack_y)};
  const __m256 second[kEight] = {
      _mm256_sub_ps(at_z, slack_z), rows[0], rows[1], rows[2], rows[3], rays.t_min, rays.t_limit, as_float(1)};
  store_rows(slots, 0, first), store_rows(slots, 32, second);
  static_assert(offsetof(Slot, triangle) == 64 && offsetof(TriangleRay, axes) == 32 &&
                offsetof(TriangleState, row) == 36 && offsetof(TriangleState, depths) == 44 &&
                offsetof(Slot, ray) == 116 && offsetof(Slot, hit_instance) == 120 &&
                offsetof(Slot, hit_primitive) == 124);
  // In the order of ShearFrame.
  const auto across = [&](const EightVectors& v)
                          __attribute__((always_inline)) { return pick({v.y, v.z, v.x}, is_x, is_y); };
  const auto upward = [&](const EightVectors& v)
                          __attribute__((always_inline)) { return pick({v.z, v.x, v.y}, is_x, is_y); };
  const auto word = [&](auto&& of_frame) __attribute__((always_inline)) {
    return pick({as_float(of_frame(kFrames[0])), as_float(of_frame(kFrames[1])), as_float(of_frame(kFrames[2]))}, is_x,
                is_y);
  };
  const __m256 direction_z = pick(direction, is_x, is_y);
  const __m256 t_slack = _mm256_mul_ps(_mm256_set1_ps(kDepthReach), long_depth);
  const __m256 at_first = _mm256_mul_ps(_mm256_sub_ps(rays.t_min, t_slack), direction_z);
  const __m256 at_last = _mm256_mul_ps(_mm256_add_ps(rays.t_limit, t_slack), direction_z);
  const __m256i runs_down = _mm256_slli_epi32(_mm256_srli_epi32(_mm256_castps_si256(direction_z), 31), 24);
  const __m256 axes = word([](const ShearFrame& frame) {
    return frame.axes[0] | std::uint32_t{frame.axes[1]} << 8 | std::uint32_t{frame.axes[2]} << 16;
  });
  const __m256 third[kEight] = {
      across(origin),
      upward(origin),
      pick(origin, is_x, is_y),
      _mm256_mul_ps(across(direction), long_inverse),
      _mm256_mul_ps(upward(direction), long_inverse),
      direction_z,
      t_slack,
      _mm256_mul_ps(_mm256_set1_ps(kEdgeReach), largest_of(sum_of(vectors_of(tree), rays.away)))};
  const __m256 fourth[kEight] = {
      _mm256_or_ps(axes, _mm256_castsi256_ps(runs_down)),
      word([](const ShearFrame& frame) { return frame.row[0] | std::uint32_t{frame.row[1]} << 16; }),
      word([](const ShearFrame& frame) { return std::uint32_t{frame.row[2]}; }),
      _mm256_blendv_ps(at_first, at_last, direction_z),
      _mm256_blendv_ps(at_last, at_first, direction_z),
      _mm256_load_ps(reinterpret_cast<const float*>(ray_rows)),
      as_float(kNoHit),
      as_float(kNoHit)};
  store_rows(slots, 64, third), store_rows(slots, 96, fourth);
}

// Stores TimeFrame{0, 1, true}, and eight zero bytes after it.
static_assert(sizeof(TimeFrame) == 24 && offsetof(TimeFrame, is_direct) == 16 &&
              offsetof(ObjectRay, start) == offsetof(ObjectRay, time) + 24 &&
              offsetof(Slot, u) == offsetof(Slot, time) + 24 && offsetof(Slot, v) == offsetof(Slot, time) + 28);
PERFECT_BVH_INLINE void store_direct(TimeFrame& time) noexcept {
  constexpr long long kOne = 0x3FF0000000000000;
  _mm256_store_si256(reinterpret_cast<__m256i*>(&time), _mm256_setr_epi64x(0, kOne, 1, 0));
}

// Stores last_t() of eight rays in `slots`. Returns it in float too, which equals to_local_max() of a ray that was not
// moved.
PERFECT_BVH_INLINE __m256 set_last_t(Slot* const* slots, __m256 t_max) noexcept {
  const __m256d part = _mm256_set1_pd(0x1p-24), least = _mm256_set1_pd(0x1p-150);
  const auto last_of = [&](__m128 narrow) __attribute__((always_inline)) {
    const __m256d t = _mm256_cvtps_pd(narrow);
    return _mm256_max_pd(_mm256_add_pd(t, _mm256_add_pd(_mm256_mul_pd(part, magnitudes(t)), least)), t);
  };
  const __m256d low = last_of(_mm256_castps256_ps128(t_max)), high = last_of(_mm256_extractf128_ps(t_max, 1));
  const auto store_four = [](Slot* const* four, __m256d t) __attribute__((always_inline)) {
    const __m128d first = _mm256_castpd256_pd128(t), second = _mm256_extractf128_pd(t, 1);
    _mm_storel_pd(&four[0]->best_t, first), _mm_storeh_pd(&four[1]->best_t, first);
    _mm_storel_pd(&four[2]->best_t, second), _mm_storeh_pd(&four[3]->best_t, second);
  };
  store_four(slots, low), store_four(slots + 4, high);
  return _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low));
}

// Returns the lanes in which all components are smaller than a limit; false for NaN.
PERFECT_BVH_INLINE __m256 are_below(const EightVectors& v, float limit) noexcept {
  const __m256 most = _mm256_set1_ps(limit);
  return _mm256_and_ps(_mm256_and_ps(_mm256_cmp_ps(v.x, most, _CMP_LT_OQ), _mm256_cmp_ps(v.y, most, _CMP_LT_OQ)),
                       _mm256_cmp_ps(v.z, most, _CMP_LT_OQ));
}

// Starts eight rays of the batch, at the root of a lone instance (kDirect) or of the top level. Returns false if any of
// them is not a usual one: they must then be started one by one. At the top level, sets their constants for the tree of
// the scene's instance in place as well, if all of them are usual there.
template <bool kDirect, bool kMoves>
PERFECT_BVH_INLINE bool start_eight(Slot* const* slots, const RayBatch& batch, const std::uint32_t* ray_rows,
                                    const SceneView& scene) noexcept {
  static_assert(offsetof(Ray, t_min) == 48 && offsetof(Ray, t_max) == 52 && offsetof(Ray, mask) == 56 &&
                offsetof(Ray, time) == 60);
  const __m256d factor = _mm256_set1_pd(static_cast<double>(scene.scale));
  __m128 origins[kEight], directions[kEight], ranges[kEight];
  for (std::size_t i = 0; i < kEight; ++i) {
    const Ray& ray = batch.rays[ray_rows[i]];
    const __m256d no_minus_zero = _mm256_setzero_pd();
    const __m256d origin = _mm256_add_pd(_mm256_mul_pd(first_three(&ray.origin.x), factor), no_minus_zero);
    const __m256d direction = _mm256_mul_pd(first_three(&ray.direction.x), factor);
    ObjectRay& out = kDirect ? slots[i]->local : slots[i]->world;
    _mm256_store_pd(out.origin, origin), _mm256_store_pd(out.direction, direction);
    store_direct(out.time);
    origins[i] = _mm256_cvtpd_ps(origin), directions[i] = _mm256_cvtpd_ps(direction);
    ranges[i] = _mm_load_ps(&ray.t_min);
  }
  EightRays rays;
  rays.set(turn_columns(origins), turn_columns(directions));
  __m256 time;
  const EightVectors range = turn_columns(ranges, &time);
  const __m256 t_max = range.y, mask = range.z;
  rays.t_min = range.x;

  // Compared in float, which is stricter: the limits of lengths are powers of two, and `farthest` is reduced by the
  // rounding error.
  const EightVectors& length = rays.length;
  const auto are_near = [&](double farthest, __m256 shortest) __attribute__((always_inline)) {
    return _mm256_and_ps(are_below(rays.away, static_cast<float>(farthest) * (1.0f - 0x1p-22f)),
                         _mm256_cmp_ps(shortest, _mm256_set1_ps(static_cast<float>(kShortest)), _CMP_GT_OQ));
  };
  const InstanceView* const tree = scene.in_place;
  const __m256 shortest = _mm256_min_ps(_mm256_min_ps(length.x, length.y), length.z);
  const __m256 in_place = are_near(farthest_in_place(scene), shortest);
  __m256 usual = kDirect ? in_place : are_near(kNearby * static_cast<double>(scene.reach), largest_of(length));
  usual = _mm256_and_ps(usual, are_below(length, static_cast<float>(kLongest)));
  usual = _mm256_and_ps(usual, _mm256_cmp_ps(rays.t_min, t_max, _CMP_LE_OQ));
  if constexpr (kMoves) {
    usual = _mm256_and_ps(usual, _mm256_cmp_ps(_mm256_setzero_ps(), time, _CMP_LE_OQ));
    usual = _mm256_and_ps(usual, _mm256_cmp_ps(time, _mm256_set1_ps(1.0f), _CMP_LE_OQ));
  }
  if constexpr (kDirect) {
    const __m256i seen = _mm256_and_si256(_mm256_castps_si256(mask), _mm256_set1_epi32(static_cast<int>(tree->mask)));
    usual = _mm256_andnot_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(seen, _mm256_setzero_si256())), usual);
  }
  if (_mm256_movemask_ps(usual) != 0xFF) return false;

  rays.t_limit = set_last_t(slots, t_max);
  const TreeExtent& extent = tree != nullptr ? tree->extent : scene.extent;
  set_eight(slots, rays, kDirect ? extent : scene.extent, extent, ray_rows);
  const bool are_in_place = _mm256_movemask_ps(in_place) == 0xFF;
  for (std::size_t i = 0; i < kEight; ++i) {
    Slot& slot = *slots[i];
    store_direct(slot.time);  // u and v as well
    if constexpr (kDirect) {
      stack_of(slot)[1] = tree->root;
      if constexpr (kMoves) take_tree_step(slot, scene, *tree, batch.rays[ray_rows[i]].time);
    } else {
      slot.world_time = slot.time;
      slot.world_box = slot.box;
      slot.nodes = scene.nodes;
      if constexpr (kMoves) {
        slot.top_moment = moment_at(scene.top_times, batch.rays[ray_rows[i]].time);
        take_top_step(slot, scene);
      }
      slot.instance = are_in_place ? static_cast<std::uint32_t>(tree - scene.instances) : kNoHit, slot.floor = 0;
      stack_of(slot)[0] = kDoneMark, stack_of(slot)[1] = scene.root;
    }
  }
  return true;
}
