#include "render/appearance/node_program.h"

#include <algorithm>
#include <string>

#include "core/errors.h"

namespace perfect_bvh {
namespace {

constexpr std::size_t kMostChannels = 1 << 16;

void require(bool condition, std::size_t row, const std::string& complaint) {
  if (!condition) {
    throw InvalidArgument("render: appearance.materials.programs: instruction " + std::to_string(row) + " " +
                          complaint);
  }
}

int count_words(std::string_view words) noexcept {
  return 1 + static_cast<int>(std::count(words.begin(), words.end(), ' '));
}

// Reads integers one after another; beyond the end, returns -1.
class Codes {
 public:
  explicit Codes(std::span<const std::int32_t> codes) noexcept : codes_(codes) {}
  [[nodiscard]] bool at_end() const noexcept { return next_ >= codes_.size(); }
  [[nodiscard]] std::int32_t next() noexcept { return at_end() ? -1 : codes_[next_++]; }

 private:
  std::span<const std::int32_t> codes_;
  std::size_t next_ = 0;
};

void add_needs(const NodeInstruction& instruction, NodeNeeds& needs) noexcept {
  if (instruction.kind != NodeKind::kInput) return;
  const auto input = static_cast<NodeInput>(instruction.mode);
  const bool is_layer = input == NodeInput::kUv || input == NodeInput::kColor || input == NodeInput::kInstance;
  needs.points = needs.points || !(is_layer || input == NodeInput::kGiven);
  needs.sides = needs.sides || instruction.numbers[1] != 0.0f || input == NodeInput::kSide;
  if (input == NodeInput::kSide) needs.aside = std::max(needs.aside, instruction.numbers[1]);
}

}  // namespace

NodeProgram::NodeProgram(std::span<const std::int32_t> codes, std::span<const float> numbers, std::size_t images,
                         std::size_t instance_rows)
    : operands_(codes.size()), numbers_(numbers.begin(), numbers.end()) {
  Codes read(codes);
  std::size_t operand = 0, number = 0;
  while (!read.at_end()) {
    const std::size_t row = whole_.instructions.size();
    const std::int32_t kind = read.next();
    require(kind >= 0 && static_cast<std::size_t>(kind) < std::size(kNodeShapes), row, "has an unknown kind");
    NodeInstruction& made = whole_.instructions.emplace_back();
    made.kind = static_cast<NodeKind>(kind);
    const NodeShape& shape = shape_of(made.kind);
    const std::int32_t mode = read.next(), count = read.next();
    const auto first = static_cast<std::int32_t>(channels_);
    require(mode >= 0 && mode < count_words(shape.modes), row, "has an unknown mode");
    require(count >= 0 && static_cast<std::size_t>(count) <= numbers_.size() - number, row, "lacks numbers");
    require(shape.numbers < 0 || shape.numbers == count, row, "must have as many numbers as its kind");
    made.mode = static_cast<std::uint8_t>(mode), made.first = first;
    made.numbers = std::span(numbers_).subspan(number, static_cast<std::size_t>(count));
    made.operands = std::span(operands_).subspan(operand, shape.operands.size());
    for (const char width : shape.operands) {
      NodeOperand& to = operands_[operand++];
      to.channel = read.next(), to.step = read.next();
      const std::int32_t last = to.channel + to.step * (width - '1');
      require(to.channel >= 0 && (to.step == 0 || to.step == 1) && last < first, row,
              "reads a channel that is not written yet");
    }
    if (made.kind == NodeKind::kTable) require(count >= 8 && count % 4 == 0, row, "has a table without two whole rows");
    if (made.kind == NodeKind::kCurves) require(count >= 8 && count % 3 == 2, row, "has curves without two whole rows");
    const auto is_row_of = [&](std::size_t rows) {
      const float value = made.numbers[0];
      return value >= 0.0f && value < static_cast<float>(rows) && value == static_cast<float>(static_cast<int>(value));
    };
    if (made.kind == NodeKind::kImage || made.kind == NodeKind::kBoxImage) {
      require(is_row_of(images), row, "refers to an image that does not exist");
    }
    if (made.kind == NodeKind::kVectorTransform) require(is_row_of(9), row, "must have a pair of spaces from 0 to 8");
    if (made.kind == NodeKind::kInput) {
      const bool is_instance = static_cast<NodeInput>(mode) == NodeInput::kInstance;
      require(is_row_of(is_instance ? instance_rows : 1 << 16), row, "refers to a row that does not exist");
      const float side = made.numbers[static_cast<NodeInput>(mode) == NodeInput::kSide ? 0 : 1];
      require(side == 0.0f || side == 1.0f || side == 2.0f, row, "must have a side from 0 to 2");
    }
    number += made.numbers.size();
    channels_ += static_cast<std::size_t>(shape.channels);
    require(channels_ <= kMostChannels, row, "exceeds the limit: a program has at most 65,536 channels");
    add_needs(made, whole_.needs);
    if (made.kind == NodeKind::kSet) outputs_[made.mode] = made.operands.data();
  }
  if (const NodeOperand* const alpha = output(MaterialSlot::kAlpha)) alpha_ = part_for(*alpha);
}

// Goes from the last instruction to the first, so that an output is marked as needed before the instruction that writes
// it is reached.
NodePart NodeProgram::part_for(const NodeOperand& number) const {
  std::vector<bool> is_wanted(channels_, false);
  is_wanted[static_cast<std::size_t>(number.channel)] = true;
  NodePart part;
  for (auto instruction = whole_.instructions.rbegin(); instruction != whole_.instructions.rend(); ++instruction) {
    const NodeShape& shape = shape_of(instruction->kind);
    const auto first = is_wanted.begin() + instruction->first;
    if (std::find(first, first + shape.channels, true) == first + shape.channels) continue;
    for (std::size_t i = 0; i < shape.operands.size(); ++i) {
      const NodeOperand& operand = instruction->operands[i];
      for (int channel = 0; channel <= shape.operands[i] - '1'; ++channel) {
        is_wanted[static_cast<std::size_t>(operand.channel + channel * operand.step)] = true;
      }
    }
    part.instructions.push_back(*instruction);
    add_needs(*instruction, part.needs);
  }
  std::reverse(part.instructions.begin(), part.instructions.end());
  return part;
}

}  // namespace perfect_bvh
