// Counts a competitor's wrong closest hits by testing every triangle in double precision (query/audit.h). In: a scene
// that holds the mesh, rays. Out: counts. Answers that were judged before are not judged again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "ray_caster.h"
#include "tlas/assemble.h"

namespace perfect_bvh::bench {

struct Answers {
  std::vector<float> t;                            // infinity on a miss
  std::vector<std::int32_t> triangles, instances;  // -1 on a miss

  friend bool operator==(const Answers&, const Answers&) = default;
};

[[nodiscard]] Answers answers_of(const RayCompetitor& competitor, const std::vector<Ray>& rays);

class AnswerJudge {
 public:
  // Judges every n-th ray only, with n large enough that the work stays bounded.
  AnswerJudge(std::shared_ptr<const Snapshot> scene, const std::vector<Ray>& rays);

  [[nodiscard]] std::size_t ray_count() const noexcept { return rays_.size(); }
  [[nodiscard]] std::size_t count_wrong(const RayCompetitor& competitor);

 private:
  struct Verdict {
    Answers answers;
    std::size_t wrong;
  };
  [[nodiscard]] std::size_t judge(const Answers& answers) const;

  const std::shared_ptr<const Snapshot> scene_;
  std::vector<Ray> rays_;
  std::vector<Verdict> known_;
};

}  // namespace perfect_bvh::bench
