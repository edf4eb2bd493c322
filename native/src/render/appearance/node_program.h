// Shader nodes as a program: a list of small instructions, which native/src/render/surface/run_nodes.h runs over
// batches of hits. In: instructions that Python has made of a material's nodes. Out: a checked list.
//
// A program works on channels: rows of floats, one for each hit of the batch. An instruction reads operands and writes
// the channels that follow its first one; a number has one channel, a vector or a colour three. An operand says the
// first channel and the step to the next: with step 0 a number is read as a vector of three equal numbers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace perfect_bvh {

// By the order of kNodeKinds.
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

// An instruction's shape. operands: the widths of what it reads, a digit each; channels: how many it writes; numbers:
// how many settings it has, -1 for any number of them; modes: the kinds of it, by the names that Blender has where it
// has any.
struct NodeShape {
  std::string_view name, operands;
  int channels, numbers;
  std::string_view modes;
};

// What a hit has that nodes may ask for: the modes of kInput. Its settings are a number, where there are several of it
// (a uv map, a layer of colours, a row of the instances' values), and the side to which the place is shifted: 0 for
// none, 1 and 2 along the two directions of a bump. Of kSide they are the side, and how far it lies away, in pixels.
enum class NodeInput : std::uint8_t {
  kPosition,  // world space
  kNormal,    // of shading, towards the viewer
  kTrueNormal,
  kIncoming,  // towards where the ray came from
  kReflection,
  kBackfacing,
  kUv,            // (u, v, 0) of a uv map
  kColor,         // of the mesh's own colours
  kGenerated,     // 0 to 1 over the mesh's texture space
  kObject,        // in the instance's space
  kObjectNormal,  // there, as the mesh's winding has it, and not of unit length
  kTangent,       // there, along a uv map, and the sign of the bitangent
  kSide,          // world space, the way to the places beside it: 1 or 2
  kInstance,      // a row of the instances' own values, four channels
  kGiven,         // four numbers from outside, where nodes are evaluated without a scene
  kWindow,        // (x, y, 0), 0 to 1 over the camera's image
};

// Where kSet writes to: the fields of `Material`, and the normal.
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
  std::int32_t first = 0;  // of the channels that it writes
  std::span<const NodeOperand> operands;
  std::span<const float> numbers;
};

// What a program's hits must be known by.
struct NodeNeeds {
  bool points = false;  // where a hit lies and which way it faces
  bool sides = false;   // the places beside it, for bumps
  float aside = 0.0f;   // how far these lie away, in pixels
};

// Some of a program's instructions, in its order, which lead to what is asked for.
struct NodePart {
  std::vector<NodeInstruction> instructions;
  NodeNeeds needs;
};

class NodeProgram {
 public:
  // codes: of each instruction its kind, its mode, how many numbers it has, and then a channel and a step for each
  // operand. numbers: those of all instructions, one after the other. Each writes to the channels after those of the
  // one before it. images, instance_rows: how many of them it may ask for. Throws InvalidArgument for what is no
  // program: an instruction reads only what one before it has written.
  NodeProgram(std::span<const std::int32_t> codes, std::span<const float> numbers, std::size_t images,
              std::size_t instance_rows);
  NodeProgram(NodeProgram&&) noexcept = default;
  NodeProgram& operator=(NodeProgram&&) noexcept = default;
  NodeProgram(const NodeProgram&) = delete;
  NodeProgram& operator=(const NodeProgram&) = delete;
  ~NodeProgram() = default;

  [[nodiscard]] const NodePart& whole() const noexcept { return whole_; }
  // What leads to MaterialSlot::kAlpha; empty if nothing is set there.
  [[nodiscard]] const NodePart& alpha() const noexcept { return alpha_; }
  [[nodiscard]] std::size_t channels() const noexcept { return channels_; }
  // What is set there; null if nothing is.
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
