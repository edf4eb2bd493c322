#include "query/audit.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "math/triangle.h"
#include "query/trace.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kTaskTriangles = 2048;
constexpr std::size_t kRaysBetweenAsking = 4096;
constexpr double kNothing = std::numeric_limits<double>::infinity();

struct BallAround {
  Vec3d centre;
  double radius;
  double reach;  // largest |coordinate| of its box, or of the instance's own origin
};

// Computed from the vertices themselves: no tree, no stored box.
Aabb box_of(const Mesh& mesh) {
  Aabb box;
  for (const Vec3f position : mesh.positions) box.grow(position);
  for (const Ball& ball : mesh.balls) box.grow(perfect_bvh::box_of(ball));
  for (const auto& later : mesh.later) box.grow(box_of(*later));
  return box;
}

BallAround place_box(const Aabb& box, const Affine& place) {
  Vec3d lower{kNothing, kNothing, kNothing}, upper = -lower;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3f at{corner & 1 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                   corner & 4 ? box.upper.z : box.lower.z};
    const Vec3d world = place.point(to_double(at));
    lower = min(lower, world), upper = max(upper, world);
  }
  const Vec3d t = place.translation;
  const Vec3d most = max(max(upper, -lower), max(t, -t));
  return {(lower + upper) * 0.5, length(upper - lower) * 0.5, std::max({most.x, most.y, most.z})};
}

// Used for moving instances, so that every ray is tested against them.
BallAround whole_scene(const Aabb& bounds) {
  const double reach = reach_of(bounds);
  return {{0, 0, 0}, kNothing, reach};
}

class Audit {
 public:
  Audit(const Snapshot& snapshot, const RayColumns& columns, CancelToken& cancel)
      : snapshot_(snapshot), cancel_(cancel), cull_(columns.cull) {
    rays_.reserve(columns.count);
    for (std::size_t row = 0; row < columns.count; ++row) {
      ask_at(row);
      const Ray ray = load_ray(columns, row);
      rays_.push_back({ray, JudgedRay(ray.origin, ray.direction), is_valid(ray)});
    }
    std::unordered_map<const Mesh*, Aabb> boxes;
    first_triangle_.push_back(0);
    for (const Instance& instance : snapshot.instances) {
      const Mesh& mesh = instance.blas->mesh;
      auto [found, is_new] = boxes.try_emplace(&mesh);
      if (is_new) found->second = box_of(mesh);
      balls_.push_back(instance.motion == 0 ? place_box(found->second, instance.object_to_world)
                                            : whole_scene(snapshot.bounds));
      first_triangle_.push_back(first_triangle_.back() + (mesh.is_round() ? 1 : mesh.primitive_count()));
    }
  }

  // Every triangle of every instance, numbered consecutively. A mesh of curves or points counts as one.
  [[nodiscard]] std::size_t triangle_count() const { return first_triangle_.back(); }

  void test_triangles(std::size_t begin, std::size_t end) {
    std::vector<Finding> findings;
    auto next = std::upper_bound(first_triangle_.begin(), first_triangle_.end(), begin);
    for (auto row = static_cast<std::size_t>(next - first_triangle_.begin()) - 1; begin < end; ++row) {
      const std::size_t last = std::min(end, first_triangle_[row + 1]);
      test_instance(row, begin - first_triangle_[row], last - first_triangle_[row], findings);
      begin = last;
    }
    const std::lock_guard lock(mutex_);
    for (const Finding& finding : findings) {  // least and any: independent of the order
      AuditedRay& ray = rays_[finding.ray];
      if (finding.kind == Finding::kSure) ray.nearest_sure = std::min(ray.nearest_sure, finding.farthest_t);
      ray.is_ambiguous |= finding.kind == Finding::kUnsure;
      ray.nears_round |= finding.kind == Finding::kRound;
    }
  }

  [[nodiscard]] std::uint8_t judge(std::size_t row, float t, std::int32_t instance_id,
                                   std::int32_t primitive_id) const {
    const AuditedRay& ray = rays_[row];
    const bool is_bad = is_wrong(row, t, instance_id, primitive_id);
    if (ray.nears_round && !is_bad) return kNotJudged;
    return static_cast<std::uint8_t>((is_bad ? kWrong : 0) | (ray.is_ambiguous ? kAmbiguous : 0));
  }

 private:
  // For hits of curves and points, only checks whether they are possible.
  [[nodiscard]] bool is_wrong(std::size_t row, float t, std::int32_t instance_id, std::int32_t primitive_id) const {
    const AuditedRay& ray = rays_[row];
    if (instance_id < 0) return ray.nearest_sure < kNothing;
    if (!ray.is_valid || !(ray.ray.t_min <= t && t <= ray.ray.t_max)) return true;
    const auto& all = snapshot_.instances;
    const auto instance = std::lower_bound(all.begin(), all.end(), instance_id,
                                           [](const Instance& item, std::int32_t id) { return item.id < id; });
    if (instance == all.end() || instance->id != instance_id || (instance->mask & ray.ray.mask) == 0) return true;
    if (instance->blas->mesh.is_round()) return !ray.nears_round;
    if (primitive_id < 0 || static_cast<std::size_t>(primitive_id) >= instance->blas->mesh.primitive_count())
      return true;
    const auto index = static_cast<std::size_t>(instance - all.begin());
    const JudgedHit hit =
        judge_triangle(ray.line, triangle_of(*instance, primitive_id, ray.ray.time), margin(ray, index));
    if (hit.surely_missed || is_culled(hit)) return true;
    if (hit.has_t && std::abs(static_cast<double>(t) - hit.t) > hit.bound) return true;
    return static_cast<double>(t) - (hit.has_t ? hit.bound : 0.0) > ray.nearest_sure;
  }

  struct AuditedRay {
    Ray ray;
    JudgedRay line;
    bool is_valid;
    bool is_ambiguous = false;
    bool nears_round = false;
    double nearest_sure = kNothing;  // the largest t that may be answered for the nearest surely hit triangle
  };
  struct Finding {
    enum Kind : std::uint8_t { kSure, kUnsure, kRound };
    std::size_t ray;
    Kind kind;
    double farthest_t;
  };

  // Returns how far rounding a ray to float, in the space of an instance, moves it. This exceeds the kernels' error,
  // because they decide in double where that matters: matrices may squeeze by any factor.
  [[nodiscard]] double margin(const AuditedRay& ray, std::size_t row) const {
    return 4.0 * kFloatUlp * (balls_[row].reach + ray.line.reach);
  }

  [[nodiscard]] bool is_culled(const JudgedHit& hit) const {
    return hit.has_t && cull_ == Cull::kBack && !hit.is_front;
  }

  template <class Number>
  [[nodiscard]] static JudgedTriangle triangle_of(const Instance& instance, Number primitive, float time) {
    const TriangleIndices corners = instance.blas->mesh.triangles[static_cast<std::size_t>(primitive)];
    const WorldTriangle placed = place_triangle(instance, corners, time);
    return {placed.v0, placed.v1, placed.v2};
  }

  // Checks every kRaysBetweenAsking rays, as there may be any number of rays per triangle.
  void ask_at(std::size_t ray) const {
    if (ray % kRaysBetweenAsking == 0) cancel_.checkpoint();
  }

  void test_instance(std::size_t row, std::size_t begin, std::size_t end, std::vector<Finding>& findings) const {
    const Instance& instance = snapshot_.instances[row];
    const BallAround& ball = balls_[row];
    std::vector<std::size_t> near;
    for (std::size_t i = 0; i < rays_.size(); ++i) {
      ask_at(i);
      const AuditedRay& ray = rays_[i];
      if (!ray.is_valid || (instance.mask & ray.ray.mask) == 0) continue;
      if (!passes_by(ray.line, ball.centre, ball.radius, margin(ray, row))) near.push_back(i);
    }
    if (instance.blas->mesh.is_round()) {
      for (const std::size_t i : near) findings.push_back({i, Finding::kRound, kNothing});
      return;
    }
    if (near.empty()) return;
    const bool moves = instance.motion != 0;
    for (std::size_t primitive = begin; primitive < end; ++primitive) {
      JudgedTriangle triangle = triangle_of(instance, primitive, 0.0f);
      for (const std::size_t& i : near) {
        ask_at(static_cast<std::size_t>(&i - near.data()));
        const AuditedRay& ray = rays_[i];
        if (moves) triangle = triangle_of(instance, primitive, ray.ray.time);
        const JudgedHit hit = judge_triangle(ray.line, triangle, margin(ray, row));
        if (!hit.surely_missed && !is_culled(hit)) keep(i, ray, hit, findings);
      }
    }
  }

  static void keep(std::size_t index, const AuditedRay& ray, const JudgedHit& hit, std::vector<Finding>& findings) {
    constexpr double kLast = std::numeric_limits<float>::max();  // values beyond float are never answered
    const double low = std::max(static_cast<double>(ray.ray.t_min), -kLast);
    const double high = std::min(static_cast<double>(ray.ray.t_max), kLast);
    if (hit.has_t && (hit.t + hit.bound < low || hit.t - hit.bound > high)) return;
    const bool is_sure = hit.surely_hit && hit.t - hit.bound > low && hit.t + hit.bound < high;
    findings.push_back({index, is_sure ? Finding::kSure : Finding::kUnsure, hit.t + hit.bound});
  }

  const Snapshot& snapshot_;
  CancelToken& cancel_;
  const Cull cull_;
  std::vector<AuditedRay> rays_;
  std::vector<BallAround> balls_;  // one per instance
  std::vector<std::size_t> first_triangle_;
  std::mutex mutex_;
};

}  // namespace

void audit_answers(const Snapshot& snapshot, const RayColumns& rays, const AuditedAnswers& answers,
                   std::uint8_t* verdicts, ThreadPool& pool, int max_threads, CancelToken& cancel) {
  Audit audit(snapshot, rays, cancel);
  cancel.expect(audit.triangle_count());
  const auto test = [&](std::size_t begin, std::size_t end) {
    cancel.throw_if_stopped();
    audit.test_triangles(begin, end);
    cancel.advance(end - begin);
  };
  parallel_for(pool, audit.triangle_count(), kTaskTriangles, test, max_threads, [&] { cancel.checkpoint(); });
  for (std::size_t row = 0; row < rays.count; ++row) {
    verdicts[row] = audit.judge(row, answers.t[row], answers.instance_ids[row], answers.primitive_ids[row]);
  }
}

}  // namespace perfect_bvh
