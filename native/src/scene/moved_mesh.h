// A mesh of which only the vertices moved: it shares the triangles with the one before, and its positions go where
// those of an older one were. A system takes longer to hand out new memory than a copy takes to fill it.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <utility>

#include "core/aligned.h"
#include "core/thread_pool.h"
#include "mesh/triangle_mesh.h"

namespace perfect_bvh {

// The memory of positions that nobody looks at any more. Snapshots may hold a mesh for as long as they like, on any
// thread: its positions come here when the last of those that hold it lets it go.
class SparePositions {
 public:
  void give(AlignedVector<Vec3f> positions) noexcept {
    const std::lock_guard lock(mutex_);
    std::swap(positions_, positions);
  }
  // What was given last; empty if there is nothing.
  [[nodiscard]] AlignedVector<Vec3f> take() noexcept {
    const std::lock_guard lock(mutex_);
    return std::exchange(positions_, AlignedVector<Vec3f>());
  }

 private:
  std::mutex mutex_;
  AlignedVector<Vec3f> positions_;
};

// Throws InvalidArgument for other counts than the mesh's and for positions that are not good; `function` opens the
// message. T: float or double, which is recentred anew.
template <class T>
[[nodiscard]] std::shared_ptr<const TriangleMesh> move_vertices(const TriangleMesh& mesh,
                                                                std::span<const Vec3<T>> positions,
                                                                const std::shared_ptr<SparePositions>& spare,
                                                                ThreadPool& pool, const char* function);

}  // namespace perfect_bvh
