// Our scene of many instances of one mesh.
#pragma once

#include <memory>
#include <vector>

#include "core/thread_pool.h"
#include "instance_scene.h"
#include "scene/scene.h"

namespace perfect_bvh::bench {

class OurInstances : public InstanceScene {
 public:
  OurInstances(const Mesh& mesh, int thread_count);

  void prepare(std::span<const Affine> transforms) override;
  void add() override;
  void move() override;
  void commit() override;
  [[nodiscard]] std::shared_ptr<RayCaster> caster() const override;

  [[nodiscard]] const CommitReport& report() const noexcept { return report_; }
  [[nodiscard]] std::shared_ptr<const Snapshot> snapshot() const { return scene_.snapshot(); }

 private:
  ThreadPool pool_;
  Scene scene_;
  std::int32_t mesh_id_;
  std::vector<InstanceInput> inputs_;
  std::vector<std::int32_t> ids_;
  std::vector<Affine> transforms_;
  CommitReport report_;
};

}  // namespace perfect_bvh::bench
