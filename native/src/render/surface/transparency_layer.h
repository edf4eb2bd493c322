// Surfaces one behind another: the points at one transparency depth, and the rays that found them.
#pragma once

#include "core/aligned.h"
#include "render/surface/material.h"
#include "render/surface/specular.h"
#include "render/surface/surface.h"

namespace perfect_bvh {

// Rows are points; before the points of this depth are known, rays.
struct SurfaceLayer {
  AlignedVector<Ray> rays;
  AlignedVector<Hit> hits;
  AlignedVector<SurfacePoint> points;
  AlignedVector<std::uint32_t> owners;  // the camera ray each belongs to
  AlignedVector<float> weights;         // what the layers before let through
  AlignedVector<std::uint32_t> places;
  AlignedVector<Material> materials;
  AlignedVector<Specular> speculars;  // empty if nothing is glossy
  AlignedVector<Vec3f> light, shine;
};

// The points of one depth that lie on shadow catchers.
struct CaughtLight {
  AlignedVector<std::uint32_t> rows;  // in the layer
  AlignedVector<SurfacePoint> points;
  AlignedVector<std::uint32_t> places;
  AlignedVector<Vec3f> light, open;  // with everything there is, and with shadow catchers alone
};

}  // namespace perfect_bvh
