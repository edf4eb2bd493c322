// The engine's exceptions. Thrown at the boundary between the engine and its caller, never from a kernel.
// A message is a sentence that names the function, the argument, the expected and the actual value, and a solution.
#pragma once

#include <stdexcept>
#include <string>

namespace perfect_bvh {

// A bad argument: becomes Python's ValueError.
class InvalidArgument : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

// A query on a scene with uncommitted edits: becomes perfect_bvh.StaleSceneError.
class StaleScene : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Any other refusal of the engine: becomes perfect_bvh.EngineError.
class EngineError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The caller's progress callback, or Ctrl-C, asked a long operation to stop.
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("cancelled") {}
};

}  // namespace perfect_bvh
