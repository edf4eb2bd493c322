#include "render/surface/run_nodes.h"

#include <algorithm>
#include <cmath>

#include "render/surface/gabor.h"
#include "render/surface/node_maths.h"
#include "render/surface/noise.h"
#include "render/surface/patterns.h"
#include "render/surface/projections.h"
#include "render/surface/voronoi.h"

namespace perfect_bvh {
namespace {

// The operands and outputs of one instruction.
struct Step {
  const NodeInstruction& instruction;
  float* channels;
  std::size_t count;

  [[nodiscard]] const float* operand(std::size_t row) const noexcept {
    return channels + static_cast<std::size_t>(instruction.operands[row].channel) * kNodeLanes;
  }
  [[nodiscard]] float number(std::size_t row, std::size_t lane) const noexcept { return operand(row)[lane]; }
  [[nodiscard]] Vec3f vector(std::size_t row, std::size_t lane) const noexcept {
    const std::size_t step = static_cast<std::size_t>(instruction.operands[row].step) * kNodeLanes;
    const float* const first = operand(row) + lane;
    return {first[0], first[step], first[2 * step]};
  }
  [[nodiscard]] NodeChannel* out() const noexcept {
    return reinterpret_cast<NodeChannel*>(channels + static_cast<std::size_t>(instruction.first) * kNodeLanes);
  }
  [[nodiscard]] std::uint8_t mode() const noexcept { return instruction.mode; }

  // `work` returns a number or a vector for each lane.
  template <class Work>
  void numbers(Work work) const {
    float* const to = *out();
    for (std::size_t lane = 0; lane < count; ++lane) to[lane] = work(lane);
  }
  template <class Work>
  void vectors(Work work) const {
    NodeChannel* const to = out();
    for (std::size_t lane = 0; lane < count; ++lane) {
      const Vec3f made = work(lane);
      to[0][lane] = made.x, to[1][lane] = made.y, to[2][lane] = made.z;
    }
  }
};

// numbers: the image. With a second operand, the normal, the projection is a box, and the second number is the blend.
void look_up_image(const Step& step, const Texture& image) {
  NodeChannel* const to = step.out();
  const auto projection = static_cast<ImageProjection>(step.mode());
  const bool is_box = step.instruction.kind == NodeKind::kBoxImage;
  for (std::size_t lane = 0; lane < step.count; ++lane) {
    const Vec3f place = step.vector(0, lane);
    const Rgba color = is_box ? look_up_box(image, place, step.vector(1, lane), step.instruction.numbers[1])
                              : look_up_projected(image, projection, place);
    to[0][lane] = color.r, to[1][lane] = color.g, to[2][lane] = color.b, to[3][lane] = color.a;
  }
}

// The position of a value from 0 to 1 in a table: a row, and the fraction to the next one.
struct TablePlace {
  std::size_t row;
  float rest;
};
TablePlace place_in(float place, std::size_t rows) noexcept {
  const float at = (place > 0.0f ? std::min(place, 1.0f) : 0.0f) * static_cast<float>(rows - 1);
  const std::size_t row = std::min(static_cast<std::size_t>(at), rows - 1);
  return {row, at - static_cast<float>(row)};
}

void look_up_table(const Step& step) {
  const std::span<const float> table = step.instruction.numbers;
  const std::size_t rows = table.size() / 4;
  const bool is_constant = step.mode() == 1;
  NodeChannel* const to = step.out();
  for (std::size_t lane = 0; lane < step.count; ++lane) {
    const auto [row, rest] = place_in(step.number(0, lane), rows);
    const float* const low = &table[4 * row];
    const float* const high = &table[4 * std::min(row + 1, rows - 1)];
    for (std::size_t c = 0; c < 4; ++c) to[c][lane] = is_constant ? low[c] : low[c] + (high[c] - low[c]) * rest;
  }
}

// One channel of curves. Their table has three from `numbers[2]` on, over the range given by the first two numbers.
float through_curve(std::span<const float> numbers, std::size_t channel, float value, bool extrapolates) noexcept {
  const std::size_t rows = (numbers.size() - 2) / 3;
  const float place = (value - numbers[0]) / (numbers[1] - numbers[0]);
  const auto at = [&](std::size_t row) { return numbers[2 + 3 * row + channel]; };
  const auto steps = static_cast<float>(rows - 1);
  if (extrapolates && place < 0.0f) return at(0) + (at(0) - at(1)) * -place * steps;
  if (extrapolates && place > 1.0f) return at(rows - 1) + (at(rows - 1) - at(rows - 2)) * (place - 1.0f) * steps;
  const auto [row, rest] = place_in(place, rows);
  const float low = at(row);
  return low + (at(std::min(row + 1, rows - 1)) - low) * rest;
}

void bend_by_curves(const Step& step) {
  const std::span<const float> numbers = step.instruction.numbers;
  const bool extrapolates = step.mode() == 1;
  step.vectors([&](std::size_t lane) {
    const float share = step.number(0, lane);
    const Vec3f color = step.vector(1, lane);
    const Vec3f bent{through_curve(numbers, 0, color.x, extrapolates), through_curve(numbers, 1, color.y, extrapolates),
                     through_curve(numbers, 2, color.z, extrapolates)};
    return color * (1.0f - share) + bent * share;
  });
}

Vec3f transformed(std::span<const float> m, Vec3f v) noexcept {
  const auto row = [&](std::size_t i) { return m[i] * v.x + m[i + 1] * v.y + m[i + 2] * v.z + m[i + 3]; };
  return {row(0), row(4), row(8)};
}

Vec3f unit_or(Vec3f v, Vec3f fallback) noexcept {
  const float size = length(v);
  return size > 0.0f && std::isfinite(size) ? v * (1.0f / size) : fallback;
}

// Operands: strength, colour, tangent, its sign, the mesh's normal, the shading normal, whether the back is visible.
enum class NormalSpace : std::uint8_t { kTangent, kObject, kWorld };

void map_normals(const Step& step, const NodeInputs& inputs) {
  const auto space = static_cast<NormalSpace>(step.mode());
  step.vectors([&](std::size_t lane) {
    const float strength = step.number(0, lane), side = step.number(6, lane) != 0.0f ? -1.0f : 1.0f;
    Vec3f color = step.vector(1, lane) * 2.0f - Vec3f{1, 1, 1};
    const Vec3f normal = step.vector(5, lane);
    const bool is_tangent = space == NormalSpace::kTangent;
    if (is_tangent) {
      const Vec3f tangent = step.vector(2, lane), own = step.vector(4, lane);
      if (step.number(3, lane) == 0.0f) return normal;  // the uv map does not exist
      const float up = std::clamp(strength, 0.0f, 1.0f);
      const Vec3f across = cross(own, tangent) * step.number(3, lane);
      color = (tangent * (color.x * strength) + across * (color.y * strength)) + own * (1.0f + (color.z - 1.0f) * up);
    }
    const auto from = space == NormalSpace::kWorld ? VectorSpace::kWorld : VectorSpace::kObject;
    const Vec3f world = inputs.transformed(lane, color, VectorKind::kNormal, from, VectorSpace::kWorld);
    const Vec3f mapped = world == Vec3f{0, 0, 0} ? normal : world * side;
    if (is_tangent || strength == 1.0f) return mapped;
    return unit_or(normal + (mapped - normal) * std::max(strength, 0.0f), normal);
  });
}

// Operands: strength, distance, the height here and at both shifted points, the normal, the vectors to these points
// (Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU").
void bump(const Step& step) {
  step.vectors([&](std::size_t lane) {
    const float strength = std::max(step.number(0, lane), 0.0f), distance = step.number(1, lane);
    const float here = step.number(2, lane);
    const Vec3f normal = step.vector(5, lane), x = step.vector(6, lane), y = step.vector(7, lane);
    const Vec3f across_x = cross(y, normal), across_y = cross(normal, x);
    const float area = dot(x, across_x);
    if (!(std::abs(area) > 0.0f)) return normal;
    const Vec3f slope = across_x * (step.number(3, lane) - here) + across_y * (step.number(4, lane) - here);
    const Vec3f bent = unit_or(normal * std::abs(area) - slope * (area < 0.0f ? -distance : distance), normal);
    return unit_or(bent * strength + normal * (1.0f - strength), normal);
  });
}

// Operands: the index of refraction or the layer's visibility, the normal, the direction to the viewer, whether the
// back is visible.
void reflect_by_angle(const Step& step) {
  const bool is_layer = step.mode() == 1;
  step.numbers([&](std::size_t lane) {
    const bool is_back = step.number(3, lane) != 0.0f;
    const float value = step.number(0, lane), index = std::max(is_layer ? 1.0f - value : value, 1e-5f);
    const float eta = is_layer != is_back ? 1.0f / index : index;
    return node_fresnel(dot(step.vector(2, lane), step.vector(1, lane)), eta);
  });
}

// Procedural textures: operands in the order of the nodes' inputs, without colours that are mixed later.

// numbers: dimensions, whether it is normalized, whether more than the red channel is needed.
void run_noise(const Step& step) {
  const std::span<const float> n = step.instruction.numbers;
  NodeChannel* const to = step.out();
  for (std::size_t i = 0; i < step.count; ++i) {
    const NoiseSettings settings{static_cast<int>(n[0]), static_cast<NoiseKind>(step.mode()),
                                 n[1] != 0.0f,           step.number(2, i),
                                 step.number(3, i),      step.number(4, i),
                                 step.number(5, i),      step.number(6, i),
                                 step.number(7, i),      step.number(8, i)};
    const Vec3f p = step.vector(0, i);
    const float w = step.number(1, i);
    const Vec3f made = n[2] != 0.0f ? noise_color(settings, p, w) : Vec3f{noise_factor(settings, p, w), 0.0f, 0.0f};
    to[0][i] = made.x, to[1][i] = made.y, to[2][i] = made.z;
  }
}

// numbers: dimensions, metric, whether it is normalized. Channels: distance, colour, position, w, radius.
void run_voronoi(const Step& step) {
  const std::span<const float> n = step.instruction.numbers;
  NodeChannel* const to = step.out();
  for (std::size_t i = 0; i < step.count; ++i) {
    const VoronoiSettings settings{static_cast<int>(n[0]),
                                   static_cast<VoronoiFeature>(step.mode()),
                                   static_cast<VoronoiMetric>(static_cast<int>(n[1])),
                                   n[2] != 0.0f,
                                   step.number(2, i),
                                   step.number(3, i),
                                   step.number(4, i),
                                   step.number(5, i),
                                   step.number(6, i),
                                   step.number(7, i),
                                   step.number(8, i)};
    const VoronoiTexture made = voronoi_texture(settings, step.vector(0, i), step.number(1, i));
    const float values[] = {made.distance,   made.color.x,    made.color.y, made.color.z, made.position.x,
                            made.position.y, made.position.z, made.w,       made.radius};
    for (std::size_t c = 0; c < std::size(values); ++c) to[c][i] = values[c];
  }
}

// numbers: offset and its frequency, squash and its frequency. Channels: mortar, tint.
void run_brick(const Step& step) {
  const std::span<const float> n = step.instruction.numbers;
  NodeChannel* const to = step.out();
  for (std::size_t i = 0; i < step.count; ++i) {
    const BrickTexture made =
        brick_texture({n[0], static_cast<int>(n[1]), n[2], static_cast<int>(n[3]), step.number(1, i), step.number(2, i),
                       step.number(3, i), step.number(4, i), step.number(5, i), step.number(6, i)},
                      step.vector(0, i));
    to[0][i] = made.mortar, to[1][i] = made.tint;
  }
}

void run_texture(const Step& step) {
  const std::span<const float> n = step.instruction.numbers;
  const auto number = [&](std::size_t row, std::size_t lane) { return step.number(row, lane); };
  const auto point = [&](std::size_t lane) { return step.vector(0, lane); };
  using Lane = std::size_t;
  switch (step.instruction.kind) {
    case NodeKind::kNoise:
      return run_noise(step);
    case NodeKind::kVoronoi:
      return run_voronoi(step);
    case NodeKind::kChecker:
      return step.numbers([&](Lane i) { return checker_factor(number(1, i), point(i)); });
    case NodeKind::kBrick:
      return run_brick(step);
    case NodeKind::kGradient:
      return step.numbers([&](Lane i) { return gradient_factor(static_cast<GradientKind>(step.mode()), point(i)); });
    case NodeKind::kMagic:
      return step.vectors(
          [&](Lane i) { return magic_color({static_cast<int>(n[0]), number(1, i), number(2, i)}, point(i)); });
    case NodeKind::kWave:
      return step.numbers([&](Lane i) {
        return wave_factor(
            {static_cast<WaveKind>(static_cast<int>(n[0])), static_cast<WaveDirection>(static_cast<int>(n[1])),
             static_cast<WaveProfile>(static_cast<int>(n[2])), number(1, i), number(2, i), number(3, i), number(4, i),
             number(5, i), number(6, i)},
            point(i));
      });
    case NodeKind::kGabor:
      return step.vectors([&](Lane i) {
        return gabor_noise(
            {step.mode() == 0, number(1, i), number(2, i), number(3, i), number(4, i), step.vector(5, i)}, point(i));
      });
    default:  // kWhiteNoise
      return step.vectors([&](Lane i) { return white_noise_color(static_cast<int>(n[0]), point(i), number(1, i)); });
  }
}

void run_step(const Step& step, std::span<const Texture> images, NodeInputs& inputs) {
  const std::uint8_t mode = step.mode();
  const std::span<const float> n = step.instruction.numbers;
  const auto number = [&](std::size_t row, std::size_t lane) { return step.number(row, lane); };
  const auto vector = [&](std::size_t row, std::size_t lane) { return step.vector(row, lane); };
  using Lane = std::size_t;
  switch (step.instruction.kind) {
    case NodeKind::kConstant:
      return step.vectors([&](Lane) { return Vec3f{n[0], n[1], n[2]}; });
    case NodeKind::kInput:
      return inputs.read(static_cast<NodeInput>(mode), static_cast<int>(n[0]), static_cast<int>(n[1]), step.out());
    case NodeKind::kImage:
    case NodeKind::kBoxImage:
      return look_up_image(step, images[static_cast<std::size_t>(n[0])]);
    case NodeKind::kMath:
      return step.numbers([&](Lane i) { return node_math(mode, number(0, i), number(1, i), number(2, i)); });
    case NodeKind::kVectorMath:
      return step.vectors(
          [&](Lane i) { return node_vector_math(mode, vector(0, i), vector(1, i), vector(2, i), number(3, i)); });
    case NodeKind::kMix:
      return step.vectors([&](Lane i) { return node_mix(mode, vector(0, i), vector(1, i), vector(2, i)); });
    case NodeKind::kLuminance:
      return step.numbers([&](Lane i) { return luminance(vector(0, i)); });
    case NodeKind::kAverage:
      return step.numbers([&](Lane i) {
        const Vec3f v = vector(0, i);
        // A number that was read as a vector is the same number again.
        return v.x == v.y && v.y == v.z ? v.x : (v.x + v.y + v.z) * (1.0f / 3.0f);
      });
    case NodeKind::kCombine:
      return step.vectors([&](Lane i) { return Vec3f{number(0, i), number(1, i), number(2, i)}; });
    case NodeKind::kTable:
      return look_up_table(step);
    case NodeKind::kCurves:
      return bend_by_curves(step);
    case NodeKind::kHueSaturation:
      return step.vectors([&](Lane i) {
        return node_hue_saturation(number(0, i), number(1, i), number(2, i), number(3, i), vector(4, i));
      });
    case NodeKind::kConvert:
      return step.vectors([&](Lane i) { return node_convert(mode, vector(0, i)); });
    case NodeKind::kMapRange:
      return step.vectors([&](Lane i) {
        const Vec3f v = vector(0, i), a = vector(1, i), b = vector(2, i), c = vector(3, i), d = vector(4, i);
        const Vec3f steps = vector(5, i);
        return Vec3f{node_map_range(mode, v.x, a.x, b.x, c.x, d.x, steps.x),
                     node_map_range(mode, v.y, a.y, b.y, c.y, d.y, steps.y),
                     node_map_range(mode, v.z, a.z, b.z, c.z, d.z, steps.z)};
      });
    case NodeKind::kTransform:
      return step.vectors([&](Lane i) { return transformed(n, vector(0, i)); });
    case NodeKind::kMapping:
      return step.vectors(
          [&](Lane i) { return node_mapping(mode, vector(0, i), vector(1, i), vector(2, i), vector(3, i)); });
    case NodeKind::kVectorRotate:
      return step.vectors([&](Lane i) {
        return node_vector_rotate(mode, vector(0, i), vector(1, i), vector(2, i), number(3, i), vector(4, i),
                                  n[0] != 0.0f);
      });
    case NodeKind::kFresnel:
      return reflect_by_angle(step);
    case NodeKind::kFacing:
      return step.numbers([&](Lane i) { return node_facing(dot(vector(2, i), vector(1, i)), number(0, i)); });
    case NodeKind::kNormalMap:
      return map_normals(step, inputs);
    case NodeKind::kVectorTransform:
      return step.vectors([&](Lane i) {
        return inputs.transformed(i, vector(0, i), static_cast<VectorKind>(mode),
                                  static_cast<VectorSpace>(static_cast<int>(n[0]) / 3),
                                  static_cast<VectorSpace>(static_cast<int>(n[0]) % 3));
      });
    case NodeKind::kBump:
      return bump(step);
    case NodeKind::kSet:
      return;  // NodeProgram::output
    default:
      return run_texture(step);
  }
}

}  // namespace

void NodeRun::run(const NodeProgram& program, const NodePart& part, std::span<const Texture> images, NodeInputs& inputs,
                  std::size_t count) {
  if (channels_.size() < program.channels() * kNodeLanes) channels_.resize(program.channels() * kNodeLanes);
  for (const NodeInstruction& instruction : part.instructions) {
    run_step({instruction, channels_.data(), count}, images, inputs);
  }
}

}  // namespace perfect_bvh
