// What work costs on this machine, in nanoseconds of one thread: what the governor reckons with.
// In: numbers that were measured once (perfect_bvh.calibration in Python). Plain data, so that decisions repeat.
#pragma once

#include <cstddef>

#include "builders/build_config.h"

namespace perfect_bvh {

// Building costs are those of a mesh of this many triangles; the time of larger ones grows by their logarithm, too.
inline constexpr double kCalibratedTriangles = 65536;

struct BuilderCost {
  double build_nanoseconds = 0;  // a triangle, from the mesh to what rays are traced through
  double trace_nanoseconds = 0;  // a ray that meets the mesh's box
};

// Without a measurement updates are free, and a node costs what a leaf does.
struct Calibration {
  double node_nanoseconds = 1;           // of visiting a wide node ...
  double leaf_nanoseconds = 1;           // ... and a leaf block of up to 8 triangles
  double refit_nanoseconds = 0;          // a triangle
  double rotate_nanoseconds = 0;         // a triangle, beyond the refit
  double rebuild_parts_nanoseconds = 0;  // a triangle in the parts, beyond the refit and as much for putting them in
  double rotation_gain = 0.5;            // the share of what new parts gain that rotations do
  BuilderCost fast, binned, spatial;

  [[nodiscard]] const BuilderCost& of(BuilderKind kind) const noexcept {
    switch (kind) {
      case BuilderKind::kFast:
        return fast;
      case BuilderKind::kSpatial:
        return spatial;
      default:  // the others are for comparisons and are not chosen for speed
        return binned;
    }
  }
};

}  // namespace perfect_bvh
