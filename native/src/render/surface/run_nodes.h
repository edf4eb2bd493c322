// Runs a node program over a batch of hits. In: the program and the hits' data. Out: rows of floats, one row per
// channel.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/aligned.h"
#include "math/vec3.h"
#include "render/appearance/appearance.h"
#include "render/appearance/node_program.h"

namespace perfect_bvh {

inline constexpr std::size_t kNodeLanes = 64;  // hits processed together
using NodeChannel = float[kNodeLanes];

// In the order of a Vector Transform's modes. Its setting is the source space times 3, plus the target space.
// Camera: see RayMaker::frame.
enum class VectorKind : std::uint8_t { kPoint, kVector, kNormal };
enum class VectorSpace : std::uint8_t { kWorld, kObject, kCamera };

// The data that nodes may read about the hits of one batch.
class NodeInputs {
 public:
  NodeInputs() = default;
  NodeInputs(const NodeInputs&) = delete;
  NodeInputs& operator=(const NodeInputs&) = delete;
  virtual ~NodeInputs() = default;

  // Fills four channels; see NodeInput for the number and the side.
  virtual void read(NodeInput input, int number, int side, NodeChannel* channels) = 0;
  // Returns normals of unit length; zero for a vector without direction.
  [[nodiscard]] virtual Vec3f transformed(std::size_t lane, Vec3f v, VectorKind kind, VectorSpace from,
                                          VectorSpace to) const = 0;
};

class NodeRun {
 public:
  // Runs for `count` hits, up to kNodeLanes. part: the part of the program to run.
  void run(const NodeProgram& program, const NodePart& part, std::span<const Texture> images, NodeInputs& inputs,
           std::size_t count);

  // Call after a run.
  [[nodiscard]] float number(const NodeOperand& operand, std::size_t lane) const noexcept {
    return channels_[static_cast<std::size_t>(operand.channel) * kNodeLanes + lane];
  }
  [[nodiscard]] Vec3f vector(const NodeOperand& operand, std::size_t lane) const noexcept {
    const float* const first = &channels_[static_cast<std::size_t>(operand.channel) * kNodeLanes + lane];
    const std::size_t step = static_cast<std::size_t>(operand.step) * kNodeLanes;
    return {first[0], first[step], first[2 * step]};
  }

 private:
  AlignedVector<float> channels_;
};

}  // namespace perfect_bvh
