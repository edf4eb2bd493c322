#include "query/ray_walk.h"

#include <array>
#include <limits>

#include "math/turning.h"
#include "query/round_surface.h"
#include "query/trace.h"
#include "query/tree_boxes.h"
#include "tlas/assemble.h"
#include "traverse/default_floating_point.h"
#include "wide/wide_bvh.h"

// The kernels' own tests, lane by lane.
#include "traverse/isa_scalar.h"
#include "traverse/leaf_line_scalar.h"

namespace perfect_bvh {
namespace {

// Needs the vectors and the ray's set-up.
#include "traverse/pace.inl"
#include "traverse/ray_slot.inl"
// Needs the slot.
#include "traverse/leaf_test.inl"
// Needs the leaf test.
#include "traverse/round_leaf.inl"

constexpr double kNone = std::numeric_limits<double>::infinity();

// The walk's data for an entry of the ray's stack.
struct Waiting {
  Aabb box;  // as stored
  std::uint32_t level = 0;
  float near = 0;  // where the ray enters it
};

// The tree being walked: the space of its boxes, and its owner.
struct Space {
  Affine to_world;  // from the tree's own frame, whose origin is at `centre` of the caller's
  Vec3d centre{0, 0, 0};
  double scale = 1;  // of the boxes as stored
  std::int32_t instance_id = -1, mesh_id = -1;
};

Space space_of(const Instance& instance, const Blas& blas) {
  return {instance.object_to_world, blas.mesh.centre, static_cast<double>(blas.wide.scale), instance.id,
          instance.mesh_id};
}

// Takes the steps of stream_kernel.inl for one ray, and records each of them.
class Walker {
 public:
  Walker(const Snapshot& snapshot, const SceneView& view, const Ray& ray, Cull cull)
      : snapshot_(snapshot), view_(view), ray_(ray), cull_(cull), waiting_(entries()) {
    memory_.resize(1 + (entries() * sizeof(std::uint32_t) + sizeof(Slot) - 1) / sizeof(Slot));
    top_level_.scale = static_cast<double>(snapshot.top_level.scale);
    space_ = top_level_;
  }

  RayWalk walk() {
    const bool moves = view_.motions != nullptr;
    if (view_.is_empty || !(moves ? start_ray<true>(slot(), view_, ray_) : start_ray<false>(slot(), view_, ray_))) {
      return {};
    }
    slot().time = slot().world.time;  // a single instance has no level around it
    waiting_[1] = {bounds_of_top_level(snapshot_), 0, to_local_min(slot().time, static_cast<double>(ray_.t_min))};
    if (view_.root < kBlockChild) begin_level();
    Pace pace(view_.interruption);
    while (next() != kDoneMark && !pace.should_stop()) {
      if (next() < kBlockChild) {
        visit_node();
      } else if (next() < kInstanceChild) {
        visit_leaf();
      } else if (next() == kLeaveMark) {
        leave();
      } else {
        visit_instance();
      }
    }
    return std::move(walk_);
  }

 private:
  // As many as any ray may need, and 8 more.
  [[nodiscard]] std::size_t entries() const noexcept { return std::size_t{view_.stack_entries} + 8; }
  Slot& slot() noexcept { return memory_[0]; }
  std::uint32_t next() noexcept { return stack_of(slot())[slot().top]; }

  // Called when the root is on the stack; no node around it has recorded where the ray enters it.
  void begin_level() {
    level_limit_ = to_local_max(slot().time, last_t(ray_.t_max));
    Waiting& root = waiting_[slot().top];
    WideNode around{};
    for (int axis = 0; axis < 3; ++axis) {
      around.planes[2 * axis][0] = (&root.box.lower.x)[axis];
      around.planes[2 * axis + 1][0] = (&root.box.upper.x)[axis];
    }
    root.near = test_node(around, slot().box).near.lane[0];
  }

  void visit_node() {
    const std::uint32_t top = slot().top;
    const Waiting here = waiting_[top];
    const WideNode node = node_here();
    note(WalkEvent::kEnterNode, here);
    const NodeTest test = test_node(node, slot().box);
    BoxState without_hit = slot().box;
    without_hit.t_limit = level_limit_;
    const Mask8 reached = test_node(node, without_hit).hit;
    std::array<Waiting, kWideWidth> children;
    for (std::uint32_t lane = 0; lane < kWideWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const unsigned bit = 1u << lane;
      children[lane] = {child_box(node, lane), here.level + 1, test.near.lane[lane]};
      const WalkEvent pruned = (reached & bit) != 0 ? WalkEvent::kBoxPruned : WalkEvent::kBoxMissed;
      note((test.hit & bit) != 0 ? WalkEvent::kBoxHit : pruned, children[lane]);
    }
    push(node, test.hit, children, top);
  }

  // Returns the node at the ray's time.
  [[nodiscard]] WideNode node_here() {
    const std::uint32_t row = next();
    const WideNode& node = slot().nodes[row];
    if (view_.motions == nullptr || slot().later_nodes == nullptr) return node;
    return node_between(node, slot().later_nodes[row], slot().moment);
  }

  // Replaces the node by its children, the farthest first.
  void push(const WideNode& node, Mask8 hit, const std::array<Waiting, kWideWidth>& children, std::uint32_t top) {
    for (int i = 0; i < 8; ++i) {
      const std::uint32_t place = (node.order[i] >> slot().box.rows.order_shift) & 7;
      if ((hit >> place & 1) == 0) continue;
      stack_of(slot())[top] = node.child[place];
      waiting_[top++] = children[place];
    }
    slot().top = top - 1;
  }

  void visit_leaf() {
    const std::uint32_t row = next() - kBlockChild;
    const InstanceView& instance = view_.instances[slot().instance];
    const auto test = [&](const auto& leaf) { meet_leaf(instance, leaf, row); };
    view_.motions != nullptr ? with_leaf<true>(slot(), instance, row, test)
                             : with_leaf<false>(slot(), instance, row, test);
  }

  template <class Leaf>
  void meet_leaf(const InstanceView& /*instance*/, const Leaf& leaf, std::uint32_t /*row*/) {
    const Waiting here = waiting_[slot().top];
    note(WalkEvent::kEnterLeaf, here);
    const LeafTest test = test_leaf(leaf, slot().triangle);
    TriangleState unlimited = slot().triangle;
    set_depths(unlimited, -kInfiniteDistance, kInfiniteDistance);
    const LeafTest anywhere = test_leaf(leaf, unlimited);
    const LeafCandidates candidates(anywhere);
    const unsigned repeated = repeated_lanes(leaf.primitives);
    bool is_new = false;
    for (int lane = 0; lane < 8; ++lane) {
      if ((repeated >> lane & 1) != 0) continue;
      Meeting meeting;
      const bool is_met =
          (anywhere.lanes >> lane & 1) != 0 && meet_candidate(meeting, candidates, lane, leaf, unlimited, slot().local);
      const bool is_hit = is_met && (test.lanes >> lane & 1) != 0 &&
                          take_hit(slot(), view_.instances, ray_, cull_, leaf, lane, candidates);
      is_new = is_new || is_hit;
      const double t = is_met ? meeting.t : kNone;
      const WalkEvent other = is_met ? WalkEvent::kTriangleRejected : WalkEvent::kTriangleMissed;
      note_triangle(is_hit ? WalkEvent::kTriangleHit : other, here, leaf.primitives[lane], t);
    }
    finish_leaf(is_new);
  }

  // Tests curves or points; t is where the ray enters, or where it leaves if the entry is hidden.
  void meet_leaf(const InstanceView& instance, const RoundLeaves& leaves, std::uint32_t row) {
    const Waiting here = waiting_[slot().top];
    note(WalkEvent::kEnterLeaf, here);
    const RoundList& list = leaves.round;
    const RoundCandidates candidates(leaves, row, slot().local, slot().box.t_min, slot().box.t_limit,
                                     instance.extent.reach);
    const RoundRay round = round_ray(slot().local.origin, slot().local.direction);
    bool is_new = false;
    for (int lane = 0; lane < 8; ++lane) {
      const std::uint32_t primitive = candidates.primitives[lane];
      if (lane > 0 && candidates.primitives[lane - 1] == primitive) continue;
      double t = kNone;
      if (RoundMeeting at; meet_round(at, round, list, primitive, slot().local.time)) {
        const ShownEnds shows = shown_ends(round, list, primitive, at.chord);
        t = shows.entry ? at.entry : shows.exit ? at.exit : kNone;
      }
      const bool is_hit = (candidates.lanes >> lane & 1) != 0 &&
                          take_round_hit(slot(), view_.instances, ray_, cull_, round, list, primitive);
      is_new = is_new || is_hit;
      const WalkEvent other = t < kNone ? WalkEvent::kTriangleRejected : WalkEvent::kTriangleMissed;
      note_triangle(is_hit ? WalkEvent::kTriangleHit : other, here, primitive, is_hit ? slot().best_t : t);
    }
    finish_leaf(is_new);
  }

  void finish_leaf(bool has_new_hit) {
    --slot().top;
    if (!has_new_hit) return;
    set_limit(slot());
    drop_far();
  }

  // Like drop_far_entries().
  void drop_far() {
    std::uint32_t kept = slot().floor + 1;
    for (std::uint32_t i = kept; i <= slot().top; ++i) {
      if (!(waiting_[i].near <= slot().box.t_limit)) {
        note(WalkEvent::kWaitingPruned, waiting_[i]);
        continue;
      }
      stack_of(slot())[kept] = stack_of(slot())[i];
      waiting_[kept++] = waiting_[i];
    }
    slot().top = kept - 1;
  }

  void visit_instance() {
    const Waiting here = waiting_[slot().top];
    const Instance& instance = snapshot_.instances[next() - kInstanceChild];
    const double t = to_ray_t(slot().time, here.near);
    const bool moves = view_.motions != nullptr;
    const bool is_entered =
        moves ? enter_instance<true>(slot(), view_, ray_) : enter_instance<false>(slot(), view_, ray_);
    const WalkEvent event = is_entered ? WalkEvent::kEnterInstance : WalkEvent::kSkipInstance;
    note(event, here, t, instance.id, instance.mesh_id);
    if (!is_entered) {
      --slot().top;
      return;
    }
    const Blas& blas = *instance.blas;
    space_ = space_of(posed(instance, ray_.time), blas);
    waiting_[slot().top] = {bounds_of(blas.wide, blas.mesh), 0, 0};
    begin_level();
  }

  void leave() {
    if (view_.motions != nullptr) {
      leave_instance<true, true>(slot(), view_, 0);
    } else {
      leave_instance<true, false>(slot(), view_, 0);
    }
    space_ = top_level_;
    level_limit_ = to_local_max(slot().time, last_t(ray_.t_max));
    drop_far();
  }

  void note(WalkEvent event, const Waiting& box) {
    note(event, box, to_ray_t(slot().time, box.near), space_.instance_id, space_.mesh_id);
  }
  void note(WalkEvent event, const Waiting& box, double t, std::int32_t instance_id, std::int32_t mesh_id) {
    append(event, box, event == WalkEvent::kBoxMissed ? kNone : t);
    walk_.instance_ids.push_back(instance_id);
    walk_.mesh_ids.push_back(mesh_id);
    walk_.primitive_ids.push_back(-1);
    walk_.triangles.insert(walk_.triangles.end(), 9, std::numeric_limits<double>::quiet_NaN());
  }

  void note_triangle(WalkEvent event, const Waiting& leaf, std::uint32_t primitive, double t) {
    append(event, leaf, t);
    walk_.instance_ids.push_back(space_.instance_id);
    walk_.mesh_ids.push_back(space_.mesh_id);
    const Mesh& mesh = snapshot_.instances[slot().instance].blas->mesh;
    walk_.primitive_ids.push_back(static_cast<std::int32_t>(caller_number(mesh, primitive)));
    const WorldTriangle corners = corners_of(primitive);
    for (const Vec3d& corner : {corners.v0, corners.v1, corners.v2}) append_vector(walk_.triangles, corner);
  }

  // Returns the corners; for a curve's segment, the centres of its spheres, with the first repeated.
  [[nodiscard]] WorldTriangle corners_of(std::uint32_t primitive) {
    const Instance& instance = snapshot_.instances[slot().instance];
    const Mesh& mesh = instance.blas->mesh;
    if (!mesh.is_round()) return world_triangle(snapshot_, {0, 0, 0, slot().instance, primitive}, ray_.time);
    const RoundEnds ends = ends_of(round_list(mesh, moment_of(instance, ray_.time)), primitive);
    const Affine map = place_at(instance, ray_.time);
    const auto place = [&](const double (&c)[3]) { return map.point({c[0], c[1], c[2]}); };
    return {place(ends.first.centre), place(ends.last.centre), place(ends.first.centre)};
  }

  // Appends the columns common to boxes and triangles.
  void append(WalkEvent event, const Waiting& box, double t) {
    walk_.events.push_back(event);
    walk_.levels.push_back(static_cast<std::int32_t>(box.level));
    walk_.t.push_back(t);
    walk_.nearest_t.push_back(slot().hit_instance == kNoHit ? kNone : slot().best_t);
    for (const Vec3f corner : {box.box.lower, box.box.upper}) {
      append_vector(walk_.bounds, to_double(corner) * (1.0 / space_.scale) + space_.centre);
    }
    const Affine& map = space_.to_world;
    const Vec3d origin = map.translation - map.vector(space_.centre);
    for (int row = 0; row < 3; ++row) {
      for (const Vec3d* column : {&map.x, &map.y, &map.z, &origin}) walk_.transforms.push_back((&column->x)[row]);
    }
  }
  static void append_vector(std::vector<double>& column, const Vec3d& vector) {
    column.insert(column.end(), {vector.x, vector.y, vector.z});
  }

  const Snapshot& snapshot_;
  const SceneView& view_;
  const Ray& ray_;
  const Cull cull_;
  std::vector<Waiting> waiting_;  // by position on the stack
  AlignedVector<Slot> memory_;    // the ray, and its stack behind it
  Space top_level_, space_;
  float level_limit_ = 0;  // without any hit
  RayWalk walk_;
};

}  // namespace

RayWalk walk_ray(const Snapshot& snapshot, const Ray& ray, Cull cull, CancelToken& cancel) {
  RayWalk walk;
  with_view(snapshot, cancel, [&](const SceneView& view) {
    const DefaultFloatingPoint environment;
    walk = Walker(snapshot, view, ray, cull).walk();
  });
  return walk;
}

}  // namespace perfect_bvh
