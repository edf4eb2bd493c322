// Checks the answers of closest-hit rays without any tree: tests every audited ray against every triangle of the scene,
// in double precision (math/triangle.h). Cost: the audited rays times the instanced triangles.
// In: rays and their answers. Out: for each ray, right or wrong, and whether rounding makes it ambiguous.
#pragma once

#include <cstdint>

#include "core/cancel.h"
#include "core/thread_pool.h"
#include "query/trace.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

// One row per ray; instance id -1 is a miss.
struct AuditedAnswers {
  const float* t = nullptr;
  const std::int32_t* instance_ids = nullptr;
  const std::int32_t* primitive_ids = nullptr;
};

// Bits of verdicts.
// kWrong: a miss although a triangle in range is surely hit. Or a hit of a triangle that is surely missed, masked,
// culled or does not exist. Or a hit whose t is out of range or differs from the judge's by more than its bound. Or a
// hit behind a surely hit triangle by more than both bounds.
// kAmbiguous: a triangle in range is neither surely hit nor surely missed, so several answers are right.
// kNotJudged, alone: no triangle proves the answer wrong, but the ray comes near curves or points, which have no judge.
inline constexpr std::uint8_t kWrong = 1, kAmbiguous = 2, kNotJudged = 4;

// verdicts: one row per ray.
void audit_answers(const Snapshot& snapshot, const RayColumns& rays, const AuditedAnswers& answers,
                   std::uint8_t* verdicts, ThreadPool& pool, int max_threads, CancelToken& cancel);

}  // namespace perfect_bvh
