// Programs of shader nodes: invalid programs are rejected, and valid ones give finite values for any input.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/errors.h"
#include "render/appearance/node_program.h"
#include "render/surface/run_nodes.h"

namespace perfect_bvh {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kHuge = std::numeric_limits<float>::infinity();

std::int32_t row_of(NodeKind kind) { return static_cast<std::int32_t>(kind); }

// Every lane has the same numbers.
class Given final : public NodeInputs {
 public:
  explicit Given(Rgba value) : value_(value) {}
  void read(NodeInput, int, int, NodeChannel* channels) override {
    for (std::size_t lane = 0; lane < kNodeLanes; ++lane) {
      channels[0][lane] = value_.r, channels[1][lane] = value_.g, channels[2][lane] = value_.b;
      channels[3][lane] = value_.a;
    }
  }
  [[nodiscard]] Vec3f transformed(std::size_t, Vec3f v, VectorKind, VectorSpace, VectorSpace) const override {
    return v;
  }

 private:
  Rgba value_;
};

// An input of four channels, then one instruction whose operands are all that input's first channels.
NodeProgram program_of(NodeKind kind, int mode, const std::vector<float>& numbers) {
  std::vector<std::int32_t> codes{row_of(NodeKind::kInput), 2, 2};
  std::vector<float> all{0.0f, 0.0f};
  codes.insert(codes.end(), {row_of(kind), mode, static_cast<std::int32_t>(numbers.size())});
  for (const char width : shape_of(kind).operands) {
    codes.push_back(0), codes.push_back(width == '3' ? 1 : 0);
  }
  all.insert(all.end(), numbers.begin(), numbers.end());
  return NodeProgram(codes, all, 1, 1);
}

std::vector<float> numbers_of(const NodeShape& shape, bool is_table) {
  if (is_table) return {0.0f, 1.0f, 0.2f, 0.4f, 0.6f, 0.8f, 1.0f, 0.5f};
  std::vector<float> numbers(static_cast<std::size_t>(std::max(shape.numbers, 0)), 1.0f);
  if (!numbers.empty() && (shape.name.ends_with("image") || shape.name == "input")) numbers[0] = 0.0f;
  return numbers;
}

int count_modes(std::string_view modes) { return 1 + static_cast<int>(std::count(modes.begin(), modes.end(), ' ')); }

TEST(NodeProgram, EveryKindTakesAnyNumber) {
  const float pixels[4] = {0.25f, 0.5f, 0.75f, 1.0f};
  Texture texture;
  texture.floats = pixels, texture.width = texture.height = 1;
  NodeRun run;
  for (std::size_t row = 0; row < std::size(kNodeShapes); ++row) {
    const auto kind = static_cast<NodeKind>(row);
    const NodeShape& shape = shape_of(kind);
    for (int mode = 0; mode < count_modes(shape.modes); ++mode) {
      const NodeProgram program = program_of(kind, mode, numbers_of(shape, shape.numbers < 0));
      for (const float value : {0.0f, -0.0f, 0.3f, -7.5f, 1e-42f, 1e30f, -1e30f, kHuge, -kHuge, kNan}) {
        Given given({value, value * 0.5f, 1.0f, value});
        run.run(program, program.whole(), {&texture, 1}, given, kNodeLanes);
        for (int channel = 4; channel < 4 + shape.channels; ++channel) {
          const float first = run.number({channel, 0}, 0), last = run.number({channel, 0}, kNodeLanes - 1);
          EXPECT_TRUE(first == last || (std::isnan(first) && std::isnan(last))) << shape.name << mode << " " << value;
        }
      }
    }
  }
}

void expect_refused(const std::vector<std::int32_t>& codes, const std::vector<float>& numbers, const char* why) {
  try {
    const NodeProgram program(codes, numbers, 1, 1);
    ADD_FAILURE() << "taken, though it " << why;
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
  }
}

TEST(NodeProgram, WhatIsNoneIsRefused) {
  const std::int32_t constant = row_of(NodeKind::kConstant), mean = row_of(NodeKind::kAverage);
  expect_refused({99, 0, 0}, {}, "has an unknown kind");
  expect_refused({-1, 0, 0}, {}, "has an unknown kind");
  expect_refused({constant, 1, 3}, {1, 2, 3}, "has an unknown mode");
  expect_refused({constant, 0, 3}, {1, 2}, "lacks numbers");
  expect_refused({constant, 0, 2}, {1, 2}, "must have as many numbers");
  expect_refused({constant, 0, -1}, {1, 2}, "lacks numbers");
  expect_refused({constant, 0, 3, mean, 0, 0, 1, 1}, {1, 2, 3}, "reads a channel that is not written yet");
  expect_refused({constant, 0, 3, mean, 0, 0, 0, 2}, {1, 2, 3}, "reads a channel that is not written yet");
  expect_refused({constant, 0, 3, mean, 0, 0, -1, 0}, {1, 2, 3}, "reads a channel that is not written yet");
  expect_refused({constant, 0, 3, mean, 0, 0}, {1, 2, 3}, "reads a channel that is not written yet");
  expect_refused({constant, 0, 3, row_of(NodeKind::kTable), 0, 4, 0, 0}, {1, 2, 3, 1, 2, 3, 4}, "table without two");
  expect_refused({constant, 0, 3, row_of(NodeKind::kImage), 0, 1, 0, 1}, {1, 2, 3, 1},
                 "refers to an image that does not exist");
  expect_refused({constant, 0, 3, row_of(NodeKind::kImage), 0, 1, 0, 1}, {1, 2, 3, kNan},
                 "refers to an image that does not exist");
  expect_refused({row_of(NodeKind::kInput), 6, 2}, {0, 3}, "must have a side from 0 to 2");
  expect_refused({row_of(NodeKind::kInput), 13, 2}, {1, 0}, "refers to a row that does not exist");
  const NodeProgram program(std::vector<std::int32_t>{constant, 0, 3, mean, 0, 0, 0, 1}, std::vector<float>{1, 2, 6}, 0,
                            0);
  NodeRun run;
  Given given({});
  run.run(program, program.whole(), {}, given, 1);
  EXPECT_EQ(run.number({3, 0}, 0), 3.0f);
}

TEST(NodeProgram, AlphaRunsOnlyWhatLeadsToIt) {
  const std::int32_t input = row_of(NodeKind::kInput), mix = row_of(NodeKind::kMix), set = row_of(NodeKind::kSet);
  // A uv map in channels 0 to 3 and a position in 4 to 7; a sum of both in 8 to 10, a sum of the uv in 11 to 13.
  const std::vector<std::int32_t> codes{input, 6, 2, input, 0, 2, mix, 7,   0, 0, 0, 0, 1,   4, 1, mix, 7,
                                        0,     0, 0, 0,     1, 0, 1,   set, 0, 0, 8, 1, set, 2, 0, 12,  0};
  const NodeProgram program(codes, std::vector<float>{0, 0, 0, 0}, 0, 0);
  const NodePart& part = program.alpha();
  ASSERT_EQ(part.instructions.size(), 2u);
  EXPECT_EQ(part.instructions[0].first, 0);
  EXPECT_EQ(part.instructions[1].first, 11);
  EXPECT_TRUE(program.whole().needs.points);
  EXPECT_FALSE(part.needs.points);
  NodeRun whole, alone;
  Given given({0.25f, 0.5f, 0.0f, 0.0f});
  whole.run(program, program.whole(), {}, given, 1), alone.run(program, part, {}, given, 1);
  const NodeOperand& alpha = *program.output(MaterialSlot::kAlpha);
  EXPECT_GT(alone.number(alpha, 0), 0.5f);
  EXPECT_EQ(alone.number(alpha, 0), whole.number(alpha, 0));
  EXPECT_TRUE(
      NodeProgram(std::span(codes).first(29), std::vector<float>{0, 0, 0, 0}, 0, 0).alpha().instructions.empty());
}

}  // namespace
}  // namespace perfect_bvh
