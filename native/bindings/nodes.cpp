// Shader nodes without an image: evaluates them for given numbers, and returns the materials at hits.
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>

#include "bindings/bind.h"
#include "mesh/primitive_traits.h"
#include "render/surface/run_nodes.h"
#include "render/surface/surface.h"

namespace perfect_bvh::bindings {
namespace {

// Replaces a scene as input of node programs: given numbers and, where nodes ask for a surface, points spread evenly
// over a unit cube whose top is seen from all sides.
class StandIns final : public NodeInputs {
 public:
  explicit StandIns(std::vector<std::span<const Rgba>> given) : given_(std::move(given)) {}
  void begin(std::size_t first, std::size_t count) noexcept { first_ = first, count_ = count; }

  void read(NodeInput input, int number, int, NodeChannel* channels) override {
    for (std::size_t lane = 0; lane < count_; ++lane) {
      const Rgba value = value_of(input, static_cast<std::size_t>(number), first_ + lane);
      channels[0][lane] = value.r, channels[1][lane] = value.g, channels[2][lane] = value.b;
      channels[3][lane] = value.a;
    }
  }
  // All coordinate spaces are the same.
  [[nodiscard]] Vec3f transformed(std::size_t, Vec3f v, VectorKind kind, VectorSpace, VectorSpace) const override {
    if (kind != VectorKind::kNormal) return v;
    const float size = length(v);
    return size > 0.0f && std::isfinite(size) ? v * (1.0f / size) : Vec3f{0, 0, 0};
  }

 private:
  [[nodiscard]] Rgba value_of(NodeInput input, std::size_t number, std::size_t row) const noexcept {
    // Additive recurrences with powers of the plastic number (Roberts 2018).
    const auto spread = [row](double step) {
      const double turned = 0.5 + step * static_cast<double>(row);
      return static_cast<float>(turned - std::floor(turned));
    };
    const float x = spread(0.8191725133961645), y = spread(0.6710436067037893), z = spread(0.5497004779019703);
    switch (input) {
      case NodeInput::kGiven:
      case NodeInput::kInstance:
        return number < given_.size() && row < given_[number].size() ? given_[number][row] : Rgba{};
      case NodeInput::kUv:
      case NodeInput::kWindow:
        return {x, y, 0.0f, 0.0f};
      case NodeInput::kColor:
        return {1.0f, 1.0f, 1.0f, 1.0f};
      case NodeInput::kPosition:
      case NodeInput::kObject:
      case NodeInput::kGenerated:
        return {x, y, z, 0.0f};
      case NodeInput::kNormal:
      case NodeInput::kTrueNormal:
      case NodeInput::kObjectNormal:
        return {0.0f, 0.0f, 1.0f, 0.0f};
      case NodeInput::kTangent:
        return {1.0f, 0.0f, 0.0f, 1.0f};
      case NodeInput::kIncoming:
      case NodeInput::kReflection: {
        const float side = std::sqrt(std::max(1.0f - x, 0.0f));  // cosine-weighted, as light reaches a surface
        return {side, 0.0f, std::sqrt(x), 0.0f};
      }
      default:
        return {};
    }
  }

  std::vector<std::span<const Rgba>> given_;
  std::size_t first_ = 0, count_ = 0;
};

// Evaluates channels of a program; returns (count, channels).
Array<float> evaluate_nodes(const Array<std::int32_t>& codes, const Array<float>& numbers, const py::list& images,
                            const std::vector<Array<float>>& given, const Array<std::int32_t>& channels,
                            std::size_t count) {
  std::vector<Texture> textures;
  for (const py::handle image : images) textures.push_back(read_image(image));
  std::vector<std::span<const Rgba>> rows;
  for (const Array<float>& column : given) rows.push_back(rows_of<Rgba>(as_span(column)));
  const NodeProgram program(as_span(codes), as_span(numbers), textures.size(), rows.size());
  const auto wanted = as_span(channels);
  for (const std::int32_t channel : wanted) {
    if (channel < 0 || static_cast<std::size_t>(channel) >= program.channels()) {
      throw std::invalid_argument("_core: no such channel");
    }
  }
  Array<float> values({static_cast<py::ssize_t>(count), static_cast<py::ssize_t>(wanted.size())});
  float* to = values.mutable_data();
  const py::gil_scoped_release release;
  StandIns inputs(std::move(rows));
  NodeRun run;
  for (std::size_t first = 0; first < count; first += kNodeLanes) {
    const std::size_t lanes = std::min(kNodeLanes, count - first);
    inputs.begin(first, lanes);
    run.run(program, program.whole(), textures, inputs, lanes);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      for (const std::int32_t channel : wanted) *to++ = run.number({channel, 0}, lane);
    }
  }
  return values;
}

// Returns for each node: name, widths of operands, channels, numbers, modes.
py::list node_shapes() {
  py::list shapes;
  for (const NodeShape& shape : kNodeShapes) {
    shapes.append(py::make_tuple(std::string(shape.name), std::string(shape.operands), shape.channels, shape.numbers,
                                 std::string(shape.modes)));
  }
  return shapes;
}

// The columns of materials_at(), in order.
constexpr std::size_t kMaterialColumns = 21;
void store(const Material& material, float* to) noexcept {
  const auto put = [&to](Vec3f v) { *to++ = v.x, *to++ = v.y, *to++ = v.z; };
  put(material.color), put(material.metal), put(material.tint), put(material.specular_tint);
  for (const float value :
       {material.alpha, material.metallic, material.roughness, material.reflectance, material.transmission,
        material.translucency, material.ior, material.even_metal, material.plain_refraction}) {
    *to++ = value;
  }
}

// Finds the engine's segment or sphere from the callers' data of a hit on curves or points. The table is rebuilt when
// hits change to another mesh.
class RoundParts {
 public:
  void find(const Mesh& mesh, std::size_t part, float u, Hit& hit) {
    if (&mesh != mesh_) list(mesh);
    const auto is_before = [&mesh](std::uint32_t primitive, std::size_t wanted) {
      return caller_number(mesh, primitive) < wanted;
    };
    const auto found = std::lower_bound(order_.begin(), order_.end(), part, is_before);
    const auto first = static_cast<std::size_t>(found - order_.begin());
    std::size_t count = 0;
    while (first + count < order_.size() && caller_number(mesh, order_[first + count]) == part) ++count;
    if (count == 0) throw InvalidArgument("materials_at: hits are of another scene");
    const float along = std::max(u, 0.0f) * static_cast<float>(count);
    const std::size_t segment = std::min(static_cast<std::size_t>(along), count - 1);
    hit.primitive_index = order_[first + segment], hit.u = along - static_cast<float>(segment);
  }

 private:
  void list(const Mesh& mesh) {
    mesh_ = &mesh;
    order_.resize(mesh.primitive_count());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint32_t>(i);
    std::stable_sort(order_.begin(), order_.end(), [&mesh](std::uint32_t a, std::uint32_t b) {
      return caller_number(mesh, a) < caller_number(mesh, b);
    });
  }

  const Mesh* mesh_ = nullptr;
  std::vector<std::uint32_t> order_;
};

Array<float> materials_at(const Snapshot& snapshot, const py::dict& appearance_values,
                          const Array<std::int32_t>& instance_ids, const Array<std::int32_t>& primitive_ids,
                          const Array<float>& uvs) {
  Appearance appearance;
  read_appearance(appearance_values, appearance);
  const auto count = static_cast<std::size_t>(instance_ids.size());
  Array<float> values({static_cast<py::ssize_t>(count), static_cast<py::ssize_t>(kMaterialColumns)});
  float* const to = values.mutable_data();
  const auto ids = as_span(instance_ids), primitives = as_span(primitive_ids);
  const auto places = rows_of<Point2>(as_span(uvs));
  const py::gil_scoped_release release;
  std::vector<std::int32_t> rows;
  for (std::size_t row = 0; row < snapshot.instances.size(); ++row) {
    const auto id = static_cast<std::size_t>(snapshot.instances[row].id);
    if (id >= rows.size()) rows.resize(id + 1, -1);
    rows[id] = static_cast<std::int32_t>(row);
  }
  RoundParts parts;
  for (std::size_t i = 0; i < count; ++i) {
    Hit hit;
    const auto id = static_cast<std::size_t>(ids[i]);
    if (id >= rows.size() || rows[id] < 0) throw InvalidArgument("materials_at: hits are of another scene");
    hit.instance_index = static_cast<std::uint32_t>(rows[id]);
    const Instance& instance = snapshot.instances[hit.instance_index];
    hit.t = 1.0f, hit.u = places[i].x, hit.v = places[i].y;
    hit.primitive_index = static_cast<std::uint32_t>(primitives[i]);
    const Mesh& mesh = instance.blas->mesh;
    if (mesh.is_round()) {
      parts.find(mesh, hit.primitive_index, hit.u, hit);
    } else if (hit.primitive_index >= mesh.primitive_count()) {
      throw InvalidArgument("materials_at: hits are of another scene");
    }
    const std::int32_t material = appearance.material_of(instance, hit.primitive_index);
    store(material_at(snapshot, appearance, ray_onto(snapshot, hit), hit, material), to + kMaterialColumns * i);
  }
  return values;
}

}  // namespace

void bind_nodes(py::module_& module) {
  module.attr("NODE_SHAPES") = node_shapes();
  module.def("evaluate_nodes", &evaluate_nodes, py::arg("codes").noconvert(), py::arg("numbers").noconvert(),
             py::arg("images"), py::arg("given"), py::arg("channels").noconvert(), py::arg("count"));
  module.def("materials_at", &materials_at, py::arg("snapshot"), py::arg("appearance"),
             py::arg("instance_ids").noconvert(), py::arg("primitive_ids").noconvert(), py::arg("uvs").noconvert());
}

}  // namespace perfect_bvh::bindings
