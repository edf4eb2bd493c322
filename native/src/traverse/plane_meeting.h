// Where a ray meets the plane of a triangle, as kernels find it.
#pragma once

namespace perfect_bvh {

// span: no edge of the triangle is longer.
struct PlaneMeeting {
  double t, span;
};

}  // namespace perfect_bvh
