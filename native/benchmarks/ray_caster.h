// A ray tracer that can be raced: its rays are in the engine's own format before timing starts, and its answers are
// read after timing has stopped.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "traverse/ray.h"

namespace perfect_bvh::bench {

// How rays are used; some engines need this information.
struct RayUse {
  bool is_any_hit = false;   // find only whether there is a hit
  bool is_coherent = false;  // neighbouring rays have nearly the same direction
};

class RayCaster {
 public:
  RayCaster() = default;
  virtual ~RayCaster() = default;
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  // Not timed: writes the rays in the engine's format, and clears the answers. Call it before every cast, because a
  // cast may overwrite the rays.
  virtual void load(std::span<const Ray> rays, RayUse use) = 0;
  // Timed: casts the loaded rays.
  virtual void cast() = 0;
  // Not timed: returns the answers of the last cast, a row a ray: after any-hit rays only the second overload may be
  // called, otherwise only the first.
  virtual void read(std::span<Hit> hits) const = 0;
  virtual void read(std::span<std::uint8_t> occluded) const = 0;

  // Runs all three, without timing.
  template <class Answer>
  void answer(std::span<const Ray> rays, RayUse use, std::span<Answer> answers) {
    load(rays, use);
    cast();
    read(answers);
  }
};

struct RayCompetitor {
  std::string name;
  std::shared_ptr<RayCaster> caster;
};

}  // namespace perfect_bvh::bench
