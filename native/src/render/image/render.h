// Renders an image of a snapshot: tiles over threads.
// In: a snapshot, a camera, an appearance, settings, the arrays to fill. Out: those arrays, the same bit for bit for
// any number of threads. The colour of a pixel depends only on its position, the seed and the sample numbers.
#pragma once

#include "core/cancel.h"
#include "render/appearance/appearance.h"
#include "render/image/tile.h"
#include "render/modes/passes.h"
#include "render/modes/shading.h"
#include "render/sampling/camera.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

// Throws InvalidArgument for settings out of range, and Cancelled if the token requests it; the arrays are then partly
// filled. Returns the subset of camera rays that the settings request, the same for any number of threads.
std::vector<SubsetRay> render(const Snapshot& snapshot, const Camera& camera, const Appearance& appearance,
                              const RenderSettings& settings, const PassTargets& targets, CancelToken& cancel);

}  // namespace perfect_bvh
