#include "answer_judge.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "query/audit.h"

namespace perfect_bvh::bench {
namespace {

constexpr std::size_t kMostTests = 100'000'000;  // of a triangle with a ray: about a second
constexpr std::size_t kLeastRays = 64, kMostRays = 1024;

}  // namespace

Answers answers_of(const RayCompetitor& competitor, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  competitor.caster->answer(rays, {}, std::span(hits));
  Answers answers;
  for (const Hit& hit : hits) {
    answers.t.push_back(hit.found() ? hit.t : std::numeric_limits<float>::infinity());
    answers.triangles.push_back(hit.found() ? static_cast<std::int32_t>(hit.primitive_index) : -1);
    answers.instances.push_back(hit.found() ? 0 : -1);
  }
  return answers;
}

AnswerJudge::AnswerJudge(std::shared_ptr<const Snapshot> scene, const std::vector<Ray>& rays)
    : scene_(std::move(scene)) {
  const std::size_t triangle_count = std::max<std::size_t>(scene_->blases.front()->mesh.primitive_count(), 1);
  const std::size_t wanted = std::clamp(kMostTests / triangle_count, kLeastRays, kMostRays);
  const std::size_t step = std::max<std::size_t>(rays.size() / wanted, 1);
  for (std::size_t i = 0; i < rays.size(); i += step) rays_.push_back(rays[i]);
}

std::size_t AnswerJudge::count_wrong(const RayCompetitor& competitor) {
  Answers answers = answers_of(competitor, rays_);
  const auto found =
      std::find_if(known_.begin(), known_.end(), [&](const Verdict& verdict) { return verdict.answers == answers; });
  if (found != known_.end()) return found->wrong;
  const std::size_t wrong = judge(answers);
  known_.push_back({std::move(answers), wrong});
  return wrong;
}

std::size_t AnswerJudge::judge(const Answers& answers) const {
  std::vector<Vec3d> origins, directions;
  std::vector<float> t_min, t_max;
  for (const Ray& ray : rays_) {
    origins.push_back(ray.origin), directions.push_back(ray.direction);
    t_min.push_back(ray.t_min), t_max.push_back(ray.t_max);
  }
  const std::uint32_t mask = ~0u;
  RayColumns columns;
  columns.count = rays_.size();
  columns.origins_double = origins.data(), columns.directions_double = directions.data();
  columns.t_min = t_min.data(), columns.t_max = t_max.data(), columns.masks = &mask;
  columns.t_min_stride = columns.t_max_stride = 1;
  std::vector<std::uint8_t> verdicts(rays_.size());
  ThreadPool pool(1);
  CancelToken cancel;
  audit_answers(*scene_, columns, {answers.t.data(), answers.instances.data(), answers.triangles.data()},
                verdicts.data(), pool, 0, cancel);
  return static_cast<std::size_t>(
      std::count_if(verdicts.begin(), verdicts.end(), [](std::uint8_t verdict) { return (verdict & kWrong) != 0; }));
}

}  // namespace perfect_bvh::bench
