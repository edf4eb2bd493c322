// A mesh's lists of primitives, by number. Copies share the memory: if only vertices move, the meshes of all frames
// have the same triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/aligned.h"
#include "math/aabb.h"
#include "math/round_segment.h"
#include "math/turning.h"
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

  // For a mesh that is built step by step: makes the list unshared, copying it if others share it.
  [[nodiscard]] AlignedVector<T>& edit() {
    if (!list_) list_ = std::make_shared<AlignedVector<T>>();
    if (list_.use_count() > 1) list_ = std::make_shared<AlignedVector<T>>(*list_);
    return *list_;
  }

 private:
  std::shared_ptr<AlignedVector<T>> list_;  // null: empty
};

using TriangleIndices = Vec3<std::uint32_t>;
using TriangleList = SharedList<TriangleIndices>;

// Mesh ----------------------------------------------------------------------------------------------------------------
// The owned, validated primitives of one kind that share a tree, in object space: for example, an indexed triangle
// mesh.
// In: positions (float or double) and triangles from the caller. Out: copies that no other code can change. Double
// positions are recentred before they are narrowed, so that data a million units from zero keeps its detail: the
// caller's object space is `centre` + stored position.

enum class PrimitiveKind : std::uint8_t { kTriangles, kCurves, kPoints };

struct Mesh {
  PrimitiveKind kind = PrimitiveKind::kTriangles;
  CurveShape shape = CurveShape::kRound;  // of curves
  AlignedVector<Vec3f> positions;         // of triangles
  TriangleList triangles;
  AlignedVector<Ball> balls;          // of curves, one after another, and of points
  SharedList<SegmentCode> segments;   // of curves
  SharedList<std::uint32_t> starts;   // the first sphere of each curve; then the number of spheres
  SharedList<ClosedCurve> closed;     // of curves, by number
  SharedList<std::uint8_t> cyclic;    // per curve: whether it is closed; only curves with all segments; empty: none
  SharedList<std::uint32_t> numbers;  // per point: the caller's number; empty if it equals its own
  Vec3d centre{0, 0, 0};              // zero for meshes given in float
  // For a mesh that moves within the shutter: the same primitives, in the same frame, at the later steps; and their
  // times.
  std::vector<std::shared_ptr<const Mesh>> later;
  StepTimes times;

  // Returns whether the primitives are curves or points, that is, spheres and hulls of two spheres.
  [[nodiscard]] bool is_round() const noexcept { return kind != PrimitiveKind::kTriangles; }
  // Returns the number of triangles' vertices, or of spheres.
  [[nodiscard]] std::size_t vertex_count() const noexcept { return positions.size() + balls.size(); }
  // These depend on the kind (mesh/primitive_traits.h).
  [[nodiscard]] std::size_t primitive_count() const noexcept;
  [[nodiscard]] Aabb primitive_box(std::size_t index) const noexcept;
  [[nodiscard]] bool moves() const noexcept { return !later.empty(); }
  [[nodiscard]] const Mesh& at_step(std::uint32_t step) const noexcept { return step == 0 ? *this : *later[step - 1]; }
  // Returns a triangle vertex at a moment, as interpolated by kernels.
  [[nodiscard]] Vec3f position_at(std::uint32_t vertex, const Moment& moment) const noexcept {
    const Vec3f a = at_step(moment.step).positions[vertex];
    if (!moment.is_between()) return a;
    const Vec3f b = at_step(moment.step + 1).positions[vertex];
    return {interpolate(moment, a.x, b.x), interpolate(moment, a.y, b.y), interpolate(moment, a.z, b.z)};
  }
  [[nodiscard]] std::span<const std::uint8_t> cyclic_curves() const noexcept { return {cyclic.data(), cyclic.size()}; }
  // Shares the curves' numbers and adjacency, but not their positions.
  void share_parts_of(const Mesh& other) {
    kind = other.kind, shape = other.shape;
    segments = other.segments, starts = other.starts, closed = other.closed, cyclic = other.cyclic;
    numbers = other.numbers;
  }
  // Only of this step.
  [[nodiscard]] std::size_t byte_count() const noexcept {
    return positions.size() * sizeof(Vec3f) + triangles.size() * sizeof(TriangleIndices) + balls.size() * sizeof(Ball) +
           (segments.size() + starts.size() + numbers.size()) * sizeof(std::uint32_t) +
           closed.size() * sizeof(ClosedCurve) + cyclic.size();
  }
};

// Copies and checks the input. `function` opens the error messages ("add_mesh: triangles[17] refers to vertex 512 but
// positions has 500 rows"). Throws InvalidArgument for non-finite positions and indices out of range.
[[nodiscard]] Mesh make_mesh(std::span<const Vec3f> positions, std::span<const Vec3<std::int32_t>> triangles,
                             const char* function);
[[nodiscard]] Mesh make_mesh(std::span<const Vec3d> positions, std::span<const Vec3<std::int32_t>> triangles,
                             const char* function);

// Parts of make_mesh(), for code that moves the vertices of a mesh: throw InvalidArgument if there are not `expected`
// positions, or for the first invalid one.
void check_count(std::size_t given, std::size_t expected, const char* function);
template <class T>
void check_positions(std::span<const Vec3<T>> positions, const char* function);
template <class T>
[[nodiscard]] bool are_good(std::span<const Vec3<T>> positions) noexcept;
[[nodiscard]] Vec3d box_centre(std::span<const Vec3d> positions) noexcept;
void narrow(std::span<const Vec3d> positions, Vec3d centre, Vec3f* narrowed) noexcept;

}  // namespace perfect_bvh
