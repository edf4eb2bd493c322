// What a mesh's primitives are made of, by number. Copies share the memory: where only vertices move, every frame's
// mesh has the same triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "core/aligned.h"
#include "math/vec3.h"

namespace perfect_bvh {

template <class T>
class SharedList {
 public:
  SharedList() noexcept = default;
  SharedList(AlignedVector<T> list) : list_(std::make_shared<AlignedVector<T>>(std::move(list))) {}

  [[nodiscard]] std::size_t size() const noexcept { return list_ ? list_->size() : 0; }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  [[nodiscard]] const T* data() const noexcept { return list_ ? list_->data() : nullptr; }
  [[nodiscard]] const T* begin() const noexcept { return data(); }
  [[nodiscard]] const T* end() const noexcept { return data() + size(); }
  [[nodiscard]] const T& operator[](std::size_t index) const noexcept { return (*list_)[index]; }

  // For a mesh that is made piece by piece: its own from now on, copied if others have it too.
  [[nodiscard]] AlignedVector<T>& edit() {
    if (!list_) list_ = std::make_shared<AlignedVector<T>>();
    if (list_.use_count() > 1) list_ = std::make_shared<AlignedVector<T>>(*list_);
    return *list_;
  }

 private:
  std::shared_ptr<AlignedVector<T>> list_;  // null: none
};

using TriangleIndices = Vec3<std::uint32_t>;
using TriangleList = SharedList<TriangleIndices>;

}  // namespace perfect_bvh
