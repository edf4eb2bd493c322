// Shader nodes as a program: a list of small instructions, which native/src/render/surface/run_nodes.h runs over
// batches of hits. In: instructions that Python made from a material's nodes. Out: a checked list.
//
// A program works on channels: rows of floats, one for each hit of the batch. An instruction reads operands and writes
// consecutive channels. A number has one channel, a vector or a colour three. An operand gives the first channel and
// the step to the next: with step 0, a number is read as a vector of three equal numbers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace perfect_bvh {

// In the order of kNodeKinds.
enum class NodeKind : std::uint8_t {
  kConstant,
  kInput,
  kImage,
  kMath,
  kVectorMath,
  kMix,
  kLuminance,
  kAverage,
  kCombine,
  kTable,
  kCurves,
  kHueSaturation,
  kConvert,
  kMapRange,
  kTransform,
  kMapping,
  kVectorRotate,
  kFresnel,
  kFacing,
  kNormalMap,
  kBump,
  kNoise,
  kVoronoi,
  kChecker,
  kBrick,
  kGradient,
  kMagic,
  kWave,
  kWhiteNoise,
  kGabor,
  kBoxImage,
  kVectorTransform,
  kSet,
};

// The signature of an instruction. operands: the width of each operand, one digit each. channels: the number of
// channels written. numbers: the number of settings, -1 for any number. modes: its variants, by Blender's names if
// there are any.
struct NodeShape {
  std::string_view name, operands;
  int channels, numbers;
  std::string_view modes;
};

// The data of a hit that nodes may read: the modes of kInput. The settings are a number, for inputs that exist several
// times (a uv map, a colour layer, a row of the instances' values), and a shift of the point: 0 for none, 1 and 2 along
// the two directions of a bump. For kSide they are the direction and the distance, in pixels.
enum class NodeInput : std::uint8_t {
  kPosition,  // world space
  kNormal,    // shading normal, towards the viewer
  kTrueNormal,
  kIncoming,  // towards the ray's origin
  kReflection,
  kBackfacing,
  kUv,            // (u, v, 0) of a uv map
  kColor,         // from the mesh's colour layers
  kGenerated,     // 0 to 1 over the mesh's texture space
  kObject,        // in the instance's space
  kObjectNormal,  // in that space, by the mesh's winding, not normalized
  kTangent,       // in that space, along a uv map, and the sign of the bitangent
  kSide,          // world space, the vector to the shifted points: 1 or 2
  kInstance,      // a row of the instances' values, four channels
  kGiven,         // four numbers from the caller, for nodes evaluated without a scene
  kWindow,        // (x, y, 0), 0 to 1 over the camera's image
};

// The targets of kSet: the fields of `Material`, and the normal.
enum class MaterialSlot : std::uint8_t {
  kColor,
  kEmission,
  kAlpha,
  kRoughness,
  kMetallic,
  kMetal,
  kReflectance,
  kSpecularTint,
  kTransmission,
  kIor,
  kTint,
  kTranslucency,
  kTranslucent,
  kNormal,
  kSheen,
  kSheenRoughness,
  kCoat,
  kCoatRoughness,
  kCoatIor,
  kCoatTint,
  kCoatNormal,
  kStretch,
  kRotation,
  kTangent,
  kDiffuseRoughness,
};
inline constexpr std::size_t kMaterialSlots = 25;

inline constexpr NodeShape kNodeShapes[] = {
    {"constant", "", 3, 3, ""},
    {"input", "", 4, 2,
     "POSITION NORMAL TRUE_NORMAL INCOMING REFLECTION BACKFACING UV COLOR GENERATED OBJECT OBJECT_NORMAL TANGENT SIDE "
     "INSTANCE GIVEN WINDOW"},
    {"image", "3", 4, 1, "FLAT EQUIRECTANGULAR SPHERE TUBE"},
    {"math", "111", 1, 0,
     "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD POWER LOGARITHM SQRT INVERSE_SQRT ABSOLUTE EXPONENT MINIMUM MAXIMUM "
     "LESS_THAN GREATER_THAN SIGN COMPARE SMOOTH_MIN SMOOTH_MAX ROUND FLOOR CEIL TRUNC FRACT MODULO FLOORED_MODULO "
     "WRAP "
     "SNAP PINGPONG SINE COSINE TANGENT ARCSINE ARCCOSINE ARCTANGENT ARCTAN2 SINH COSH TANH RADIANS DEGREES CLAMP"},
    {"vector_math", "3331", 3, 0,
     "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD CROSS_PRODUCT PROJECT REFLECT REFRACT FACEFORWARD DOT_PRODUCT DISTANCE "
     "LENGTH SCALE NORMALIZE ABSOLUTE POWER SIGN MINIMUM MAXIMUM FLOOR CEIL FRACTION MODULO WRAP SNAP SINE COSINE "
     "TANGENT"},
    {"mix", "333", 3, 0,
     "MIX DARKEN MULTIPLY BURN LIGHTEN SCREEN DODGE ADD OVERLAY SOFT_LIGHT LINEAR_LIGHT DIFFERENCE EXCLUSION SUBTRACT "
     "DIVIDE HUE SATURATION COLOR VALUE"},
    {"luminance", "3", 1, 0, ""},
    {"average", "3", 1, 0, ""},
    {"combine", "111", 3, 0, ""},
    {"table", "1", 4, -1, "LINEAR CONSTANT"},
    {"curves", "13", 3, -1, "HORIZONTAL EXTRAPOLATED"},
    {"hue_saturation", "11113", 3, 0, ""},
    {"convert", "3", 3, 0, "RGB_TO_HSV HSV_TO_RGB RGB_TO_HSL HSL_TO_RGB"},
    {"map_range", "333333", 3, 0,
     "LINEAR STEPPED SMOOTHSTEP SMOOTHERSTEP VECTOR_LINEAR VECTOR_STEPPED VECTOR_SMOOTHSTEP VECTOR_SMOOTHERSTEP"},
    {"transform", "3", 3, 12, ""},
    {"mapping", "3333", 3, 0, "POINT TEXTURE VECTOR NORMAL"},
    {"vector_rotate", "33313", 3, 1, "AXIS_ANGLE X_AXIS Y_AXIS Z_AXIS EULER_XYZ"},
    {"fresnel", "1331", 1, 0, "FRESNEL LAYER"},
    {"facing", "133", 1, 0, ""},
    {"normal_map", "1331331", 3, 0, "TANGENT OBJECT WORLD"},
    {"bump", "11111333", 3, 0, ""},
    {"noise", "311111111", 3, 3, "MULTIFRACTAL RIDGED_MULTIFRACTAL HYBRID_MULTIFRACTAL FBM HETERO_TERRAIN"},
    {"voronoi", "311111111", 9, 3, "F1 F2 SMOOTH_F1 DISTANCE_TO_EDGE N_SPHERE_RADIUS"},
    {"checker", "31", 1, 0, ""},
    {"brick", "3111111", 2, 4, ""},
    {"gradient", "3", 1, 0, "LINEAR QUADRATIC EASING DIAGONAL SPHERICAL QUADRATIC_SPHERE RADIAL"},
    {"magic", "311", 3, 1, ""},
    {"wave", "3111111", 1, 3, ""},
    {"white_noise", "31", 3, 1, ""},
    {"gabor", "311113", 3, 0, "2D 3D"},
    {"box_image", "33", 4, 2, ""},
    {"vector_transform", "3", 3, 1, "POINT VECTOR NORMAL"},
    {"set", "3", 0, 0,
     "COLOR EMISSION ALPHA ROUGHNESS METALLIC METAL REFLECTANCE SPECULAR_TINT TRANSMISSION IOR TINT TRANSLUCENCY "
     "TRANSLUCENT NORMAL SHEEN SHEEN_ROUGHNESS COAT COAT_ROUGHNESS COAT_IOR COAT_TINT COAT_NORMAL STRETCH ROTATION "
     "TANGENT DIFFUSE_ROUGHNESS"},
};

[[nodiscard]] constexpr const NodeShape& shape_of(NodeKind kind) noexcept {
  return kNodeShapes[static_cast<std::size_t>(kind)];
}

struct NodeOperand {
  std::int32_t channel = 0, step = 0;
};

struct NodeInstruction {
  NodeKind kind = NodeKind::kConstant;
  std::uint8_t mode = 0;
  std::int32_t first = 0;  // the first channel that it writes
  std::span<const NodeOperand> operands;
  std::span<const float> numbers;
};

// The data on hits that a program needs.
struct NodeNeeds {
  bool points = false;  // the position and orientation of a hit
  bool sides = false;   // the shifted points, for bumps
  float aside = 0.0f;   // their distance, in pixels
};

// A subset of a program's instructions, in order, that leads to a requested output.
struct NodePart {
  std::vector<NodeInstruction> instructions;
  NodeNeeds needs;
};

class NodeProgram {
 public:
  // codes: for each instruction its kind, its mode, the number of its settings, then a channel and a step for each
  // operand. numbers: the settings of all instructions, one after another. Each instruction writes to the channels
  // after those of the previous one. images, instance_rows: how many of them exist. Throws InvalidArgument for an
  // invalid program: an instruction may only read channels that an earlier one has written.
  NodeProgram(std::span<const std::int32_t> codes, std::span<const float> numbers, std::size_t images,
              std::size_t instance_rows);
  NodeProgram(NodeProgram&&) noexcept = default;
  NodeProgram& operator=(NodeProgram&&) noexcept = default;
  NodeProgram(const NodeProgram&) = delete;
  NodeProgram& operator=(const NodeProgram&) = delete;
  ~NodeProgram() = default;

  [[nodiscard]] const NodePart& whole() const noexcept { return whole_; }
  // Returns the instructions for MaterialSlot::kAlpha; empty if it is not set.
  [[nodiscard]] const NodePart& alpha() const noexcept { return alpha_; }
  [[nodiscard]] std::size_t channels() const noexcept { return channels_; }
  // Returns the operand set there; null if there is none.
  [[nodiscard]] const NodeOperand* output(MaterialSlot slot) const noexcept {
    return outputs_[static_cast<std::size_t>(slot)];
  }

 private:
  [[nodiscard]] NodePart part_for(const NodeOperand& number) const;

  NodePart whole_, alpha_;
  std::vector<NodeOperand> operands_;  // of all instructions
  std::vector<float> numbers_;
  std::size_t channels_ = 0;
  std::array<const NodeOperand*, kMaterialSlots> outputs_{};
};

}  // namespace perfect_bvh
