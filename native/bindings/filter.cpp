// The denoiser without a library. The Python face hands over checked arrays, which it keeps alive.
#include <pybind11/stl.h>

#include <array>
#include <optional>

#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/progress.h"
#include "render/filter/joint_filter.h"

namespace perfect_bvh::bindings {
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

}  // namespace perfect_bvh::bindings
