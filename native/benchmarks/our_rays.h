// Our kernels as a competitor: rays as the engine's C++ interface takes them. The kernels trace in the default
// floating-point environment, which they set themselves.
#pragma once

#include <string>
#include <vector>

#include "ray_sets.h"
#include "tlas/assemble.h"
#include "traverse/dispatch.h"

namespace perfect_bvh::bench {

class OurRays : public RayCaster {
 public:
  // isa: one of available_kernels(); an empty name lets the engine choose.
  explicit OurRays(std::shared_ptr<const Snapshot> scene, std::string isa = "", TraceOptions options = {});

  void load(std::span<const Ray> rays, RayUse use) override;
  void cast() override;
  void read(std::span<Hit> hits) const override;
  void read(std::span<std::uint8_t> occluded) const override;

 private:
  const std::shared_ptr<const Snapshot> scene_;
  const std::string isa_;
  const TraceOptions options_;
  RayUse use_;
  std::vector<Ray> rays_;
  std::vector<Hit> hits_;
  std::vector<std::uint8_t> occluded_;
};

// Mean work of a ray. Counted in a separate run, which is not timed.
struct Visits {
  double nodes = 0, triangles = 0;
};
[[nodiscard]] Visits count_visits(const Snapshot& scene, const RaySet& set);

}  // namespace perfect_bvh::bench
