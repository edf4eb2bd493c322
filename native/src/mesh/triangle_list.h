// The triangles of a mesh. Copies share the memory: where only vertices move, every frame's mesh has the same ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "core/aligned.h"
#include "math/vec3.h"

namespace perfect_bvh {

using TriangleIndices = Vec3<std::uint32_t>;

class TriangleList {
 public:
  TriangleList() noexcept = default;
  TriangleList(AlignedVector<TriangleIndices> triangles)
      : list_(std::make_shared<AlignedVector<TriangleIndices>>(std::move(triangles))) {}

  [[nodiscard]] std::size_t size() const noexcept { return list_ ? list_->size() : 0; }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] const TriangleIndices* data() const noexcept { return list_ ? list_->data() : nullptr; }
  [[nodiscard]] const TriangleIndices* begin() const noexcept { return data(); }
  [[nodiscard]] const TriangleIndices* end() const noexcept { return data() + size(); }
  [[nodiscard]] const TriangleIndices& operator[](std::size_t index) const noexcept { return (*list_)[index]; }

  // For a mesh that is made piece by piece: its own from now on, copied if others have it too.
  [[nodiscard]] AlignedVector<TriangleIndices>& edit() {
    if (!list_) list_ = std::make_shared<AlignedVector<TriangleIndices>>();
    if (list_.use_count() > 1) list_ = std::make_shared<AlignedVector<TriangleIndices>>(*list_);
    return *list_;
  }

 private:
  std::shared_ptr<AlignedVector<TriangleIndices>> list_;  // null: none
};

}  // namespace perfect_bvh
