// An image of a snapshot: tiles over threads.
// In: a snapshot, a camera, an appearance, settings, the arrays to fill. Out: those arrays, the same bit for bit for
// any number of threads. The colour of a pixel depends on its place, the seed and the sample numbers alone.
#pragma once

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/image/tile.h"
#include "render/modes/passes.h"
#include "render/modes/shading.h"
#include "render/sampling/camera.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

// Throws InvalidArgument for settings out of range, and Cancelled when the token asks to stop; the arrays are then
// filled in part. Returns the share of camera rays that the settings ask for, the same for any number of threads.
std::vector<SubsetRay> render(const Snapshot& snapshot, const Camera& camera, const Appearance& appearance,
                              const RenderSettings& settings, const PassTargets& targets, CancelToken& cancel);

}  // namespace perfect_bvh
