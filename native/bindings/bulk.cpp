// Loops over instances and triangles that keep a scene in sync with another program. In Python they would cost more
// than the engine's own work. They hold no algorithms, only long loops.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <tuple>
#include <vector>

#include "bindings/bind.h"
#include "core/thread_pool.h"
#include "math/float4.h"
#include "render/filter/film.h"

namespace perfect_bvh::bindings {
namespace {

constexpr std::size_t kGrain = 16384;
constexpr py::ssize_t kRows = 3, kColumns = 4;  // of a transform

void check(bool holds, const char* expected) {
  if (!holds) throw std::invalid_argument(std::string("_core: expected ") + expected);
}

bool are_transforms(const Array<float>& array) {
  return array.ndim() == 3 && array.shape(1) == kRows && array.shape(2) == kColumns;
}

// The rows of a matrix that is stored column by column.
struct MatrixRows {
  explicit MatrixRows(const float* columns) {
    for (int i = 0; i < 4; ++i) rows[i] = Float4::load_unaligned(columns + i * 4);
    transpose(rows[0], rows[1], rows[2], rows[3]);
  }
  Float4 rows[4];
};

// product = parent * local. The sums are in the same order as Blender's, so that even the last bits agree.
void place(const float* parent, const MatrixRows& local, float* product) {
  for (int row = 0; row < kRows; ++row) {
    const float* p = parent + row * kColumns;
    const auto& l = local.rows;
    const Float4 sum = (l[0] * Float4(p[0]) + l[1] * Float4(p[1])) + (l[2] * Float4(p[2]) + l[3] * Float4(p[3]));
    sum.store_unaligned(product + row * kColumns);
  }
}

bool is_within(const float* values, float largest) {
  bool within = true;  // false for NaN
  for (int i = 0; i < kRows * kColumns; ++i) within &= std::abs(values[i]) <= largest;
  return within;
}

// Multiplies parent (4, 4), row-major or None, with local (N, 4, 4), column-major, into placed (N, 3, 4), row-major.
// Returns the indices of the transforms that hold a value beyond `largest`, ascending.
Array<std::int32_t> place_instances(const std::optional<Array<float>>& parent, const Array<float>& local,
                                    Array<float>& placed, float largest) {
  check(local.ndim() == 3 && local.shape(1) == 4 && local.shape(2) == 4, "local matrices of shape (rows, 4, 4)");
  check(!parent || parent->size() == 16, "a parent of shape (4, 4)");
  check(are_transforms(placed) && placed.shape(0) == local.shape(0), "as many placed transforms as local ones");
  const auto count = static_cast<std::size_t>(local.shape(0));
  const float* matrix = parent ? parent->data() : nullptr;
  const float* from = local.data();
  float* to = placed.mutable_data();
  std::vector<std::int32_t> bad;
  {
    const py::gil_scoped_release release;
    std::mutex mutex;
    parallel_for(ThreadPool::shared(), count, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        float* product = to + i * kRows * kColumns;
        const MatrixRows rows(from + i * 16);
        if (matrix == nullptr) {
          for (int row = 0; row < kRows; ++row) rows.rows[row].store_unaligned(product + row * kColumns);
        } else {
          place(matrix, rows, product);
        }
        if (is_within(product, largest)) continue;
        const std::lock_guard lock(mutex);
        bad.push_back(static_cast<std::int32_t>(i));
      }
    });
    std::sort(bad.begin(), bad.end());
  }
  return Array<std::int32_t>(static_cast<py::ssize_t>(bad.size()), bad.data());
}

// Returns (I,) bool: whether transform i differs in any bit from the old transform rows[i] (without `rows`, from old
// transform i). False where rows[i] is negative.
py::array_t<bool> find_moved(const Array<float>& old_transforms, const Array<float>& new_transforms,
                             const std::optional<Array<std::int32_t>>& rows) {
  check(are_transforms(old_transforms) && are_transforms(new_transforms), "transforms of shape (rows, 3, 4)");
  const auto count = static_cast<std::size_t>(new_transforms.shape(0));
  const auto old_count = static_cast<std::size_t>(old_transforms.shape(0));
  check(rows ? static_cast<std::size_t>(rows->size()) == count : old_count == count, "as many rows as transforms");
  py::array_t<bool> moved(new_transforms.shape(0));
  bool* out = moved.mutable_data();
  const float *before = old_transforms.data(), *now = new_transforms.data();
  const std::int32_t* picked = rows ? rows->data() : nullptr;
  std::atomic<bool> is_outside{false};
  {
    const py::gil_scoped_release release;
    constexpr std::size_t kWidth = kRows * kColumns;
    parallel_for(ThreadPool::shared(), count, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::ptrdiff_t row = picked ? picked[i] : static_cast<std::ptrdiff_t>(i);
        const bool is_held = row >= 0 && static_cast<std::size_t>(row) < old_count;
        if (row >= 0 && !is_held) is_outside = true;
        out[i] = is_held && std::memcmp(before + static_cast<std::size_t>(row) * kWidth, now + i * kWidth,
                                        kWidth * sizeof(float)) != 0;
      }
    });
  }
  check(!is_outside, "rows of the old transforms");
  return moved;
}

// Returns whether corner_verts[corner_triangles] equals triangles. An index out of range counts as a difference.
bool are_triangles(const Array<std::int32_t>& corner_verts, const Array<std::int32_t>& corner_triangles,
                   const Array<std::int32_t>& triangles) {
  if (corner_triangles.size() != triangles.size()) return false;
  const auto verts = as_span(corner_verts), corners = as_span(corner_triangles), expected = as_span(triangles);
  const auto count = static_cast<std::uint32_t>(verts.size());
  const py::gil_scoped_release release;
  std::atomic<bool> same{true};
  parallel_for(ThreadPool::shared(), corners.size(), 16 * kGrain, [&](std::size_t begin, std::size_t end) {
    if (!same) return;
    // Work in blocks that fit in the first level cache: the range of a whole block is checked first, then each value.
    constexpr std::size_t kBlock = 1024;
    for (; begin < end; begin += kBlock) {
      const std::size_t stop = std::min(end, begin + kBlock);
      std::uint32_t outside = 0, other = 0;
      for (std::size_t i = begin; i < stop; ++i) outside |= static_cast<std::uint32_t>(corners[i]) >= count ? 1u : 0u;
      if (outside == 0) {
        for (std::size_t i = begin; i < stop; ++i) {
          other |= static_cast<std::uint32_t>(verts[static_cast<std::uint32_t>(corners[i])] ^ expected[i]);
        }
      }
      if ((outside | other) != 0) {
        same = false;
        return;
      }
    }
  });
  return same;
}

// Copies source to target, of equal size. Returns whether all numbers are within `largest`; NaN is not.
bool copy_within(const Array<float>& source, Array<float>& target, float largest) {
  check(source.size() == target.size(), "a target as large as the source");
  const auto from = as_span(source);
  float* const to = target.mutable_data();
  const py::gil_scoped_release release;
  std::atomic<bool> within{true};
  parallel_for(ThreadPool::shared(), from.size(), 6 * kGrain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t beyond = 0;
    for (std::size_t i = begin; i < end; ++i) beyond |= std::abs(from[i]) <= largest ? 0u : 1u;
    if (beyond != 0) within = false;
    std::memcpy(to + begin, &from[begin], (end - begin) * sizeof(float));
  });
  return within;
}

// Returns whether two arrays have the same bits, dtype and shape. Most arrays that differ do so in their first bytes.
bool are_equal(const py::array& a, const py::array& b) {
  check((a.flags() & b.flags() & py::array::c_style) != 0, "arrays in C order");
  if (!a.dtype().is(b.dtype()) && !a.dtype().equal(b.dtype())) return false;
  if (!std::equal(a.shape(), a.shape() + a.ndim(), b.shape(), b.shape() + b.ndim())) return false;
  const auto *first = static_cast<const char*>(a.data()), *second = static_cast<const char*>(b.data());
  const auto count = static_cast<std::size_t>(a.nbytes());
  const py::gil_scoped_release release;
  constexpr std::size_t kGlance = 4096;
  if (first == second || count == 0) return true;
  if (std::memcmp(first, second, std::min(count, kGlance)) != 0) return false;
  std::atomic<bool> same{true};
  parallel_for(ThreadPool::shared(), count, 64 * kGrain, [&](std::size_t begin, std::size_t end) {
    if (same && std::memcmp(first + begin, second + begin, end - begin) != 0) same = false;
  });
  return same;
}

}  // namespace

void bind_bulk(py::module_& module) {
  module.def("place_instances", &place_instances, py::arg("parent").noconvert(), py::arg("local").noconvert(),
             py::arg("placed").noconvert(), py::arg("largest"));
  module.def("find_moved", &find_moved, py::arg("old_transforms").noconvert(), py::arg("new_transforms").noconvert(),
             py::arg("rows").noconvert() = std::nullopt);
  module.def("are_equal", &are_equal, py::arg("first"), py::arg("second"));
  module.def("copy_within", &copy_within, py::arg("source").noconvert(), py::arg("target").noconvert(),
             py::arg("largest"));
  module.def("are_triangles", &are_triangles, py::arg("corner_verts").noconvert(),
             py::arg("corner_triangles").noconvert(), py::arg("triangles").noconvert());
}

// Filter --------------------------------------------------------------------------------------------------------------
// The denoiser that needs no library. The Python layer passes checked arrays and keeps them alive.

namespace {

using Image = Array<float>;

std::span<const Vec3f> pixels_of(const std::optional<Image>& image, std::array<py::ssize_t, 2> size) {
  if (!image) return {};
  if (image->ndim() != 3 || image->shape(0) != size[0] || image->shape(1) != size[1] || image->shape(2) != 3) {
    throw std::invalid_argument("_core: the images to filter must be (H, W, 3), all of one size");
  }
  return {reinterpret_cast<const Vec3f*>(image->data()), static_cast<std::size_t>(size[0] * size[1])};
}

void filter(const Image& color, const std::optional<Image>& albedo, const std::optional<Image>& normal, Image& out,
            int threads, const py::object& progress) {
  if (color.ndim() != 3) throw std::invalid_argument("_core: the images to filter must be (H, W, 3)");
  const std::array size{color.shape(0), color.shape(1)};
  JointFilterImages images;
  images.height = static_cast<int>(size[0]), images.width = static_cast<int>(size[1]);
  images.color = pixels_of(color, size);
  images.albedo = pixels_of(albedo, size), images.normal = pixels_of(normal, size);
  images.out = {reinterpret_cast<Vec3f*>(out.mutable_data()), pixels_of(out, size).size()};
  with_progress(progress, [&](CancelToken& cancel) { joint_filter(images, threads, cancel); });
}

}  // namespace

void bind_filter(py::module_& module) {
  module.def("joint_filter", &filter, py::arg("color").noconvert(), py::arg("albedo").noconvert().none(true),
             py::arg("normal").noconvert().none(true), py::arg("out").noconvert(), py::arg("threads"),
             py::arg("progress"));
}

// Camera --------------------------------------------------------------------------------------------------------------

namespace {

const std::map<std::string, Projection> kProjections{{"perspective", Projection::kPerspective},
                                                     {"orthographic", Projection::kOrthographic},
                                                     {"equirectangular", Projection::kEquirectangular}};

}  // namespace

Camera read_camera(const py::dict& values) {
  Camera camera;
  const auto matrix = get<Array<double>>(values, "matrix");
  const double* m = matrix.data();
  camera.camera_to_world = {{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}, {m[3], m[7], m[11]}};
  using Four = std::tuple<double, double, double, double>;
  std::tie(camera.left, camera.right, camera.bottom, camera.top) = get<Four>(values, "window");
  camera.projection = kProjections.at(get<std::string>(values, "projection"));
  camera.clip_start = get<float>(values, "clip_start");
  camera.clip_end = get<float>(values, "clip_end");
  using FourFloats = std::tuple<float, float, float, float>;
  std::tie(camera.border_left, camera.border_right, camera.border_bottom, camera.border_top) =
      get<FourFloats>(values, "border");
  if (!values["lens"].is_none()) {
    const auto lens = values["lens"].cast<py::dict>();
    camera.lens = Lens{get<double>(lens, "radius"), get<double>(lens, "focus_distance"), get<int>(lens, "blades"),
                       get<double>(lens, "rotation"), get<double>(lens, "ratio")};
  }
  return camera;
}

Shutter read_shutter(const py::dict& values) {
  Shutter shutter;
  const auto times = get<Array<float>>(values, "times");
  shutter.times.assign(times.data(), times.data() + times.size());
  if (!values["rolling"].is_none()) shutter.rolling = get<float>(values, "rolling");
  shutter.blurs = get<bool>(values, "blurs");
  shutter.frame_time = get<float>(values, "frame_time");
  for (const py::handle camera : values["cameras"]) shutter.cameras.push_back(read_camera(camera.cast<py::dict>()));
  return shutter;
}

}  // namespace perfect_bvh::bindings
