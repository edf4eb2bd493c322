// Measures a snapshot: one pass over every tree's nodes.
#pragma once

#include "scene/snapshot.h"
#include "stats/scene_statistics.h"

namespace perfect_bvh {

[[nodiscard]] SceneStatistics measure(const Snapshot& snapshot);

}  // namespace perfect_bvh
