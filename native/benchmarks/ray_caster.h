// A way of casting rays that can be raced: an engine's rays stand ready in its own format before the clock starts, and
// its answers are read after the clock has stopped.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "traverse/ray.h"

namespace perfect_bvh::bench {

// What rays are for: some engines want to know.
struct RayUse {
  bool is_any_hit = false;   // whether anything is hit, and no more
  bool is_coherent = false;  // neighbours go nearly the same way
};

class RayCaster {
 public:
  RayCaster() = default;
  virtual ~RayCaster() = default;
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  // Not timed: writes the rays in the engine's format, and clears the answers. To be called before every cast, which
  // may overwrite the rays.
  virtual void load(std::span<const Ray> rays, RayUse use) = 0;
  // Timed: casts what was loaded.
  virtual void cast() = 0;
  // Not timed: what the last cast found, a row a ray. Of any hit only the second may be asked, otherwise the first.
  virtual void read(std::span<Hit> hits) const = 0;
  virtual void read(std::span<std::uint8_t> occluded) const = 0;

  // All three in whatever time.
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
