// The memory that a mesh takes.
#pragma once

#include <cstddef>

#include "scene/instance.h"
#include "wide/wide_cost.h"

namespace perfect_bvh {

// Of what refits go by; 0 before the first one.
[[nodiscard]] inline std::size_t plan_byte_count(const Blas& blas) noexcept {
  return blas.refit_plan.byte_count() + (blas.fresh_costs ? blas.fresh_costs->byte_count() : 0);
}

// Geometry, tree and plan.
[[nodiscard]] inline std::size_t byte_count(const Blas& blas) noexcept {
  return blas.mesh.byte_count() + blas.wide.byte_count() + plan_byte_count(blas);
}

}  // namespace perfect_bvh
