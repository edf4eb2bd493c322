// Embree as a peer on curves and points: one scene over one geometry of Embree's own type.
#pragma once

#include <embree4/rtcore.h>

#include <span>
#include <string>

#include "round_scene.h"

namespace perfect_bvh::bench {

// Round or flat from point to point, or round along the Catmull-Rom curve through the points, whose end points are
// doubled. Points are spheres for every shape.
enum class EmbreeShape { kRound, kFlat, kCubic };

class EmbreeRound {
 public:
  struct Options {
    EmbreeShape shape = EmbreeShape::kRound;
    int thread_count = 2;  // for building; see EmbreePeer::Options
    bool is_refitted = false;
  };

  EmbreeRound(const RoundScene& scene, const Options& options);
  ~EmbreeRound();
  EmbreeRound(const EmbreeRound&) = delete;
  EmbreeRound& operator=(const EmbreeRound&) = delete;

  [[nodiscard]] RTCScene scene() const noexcept { return scene_; }
  // Bytes of the scene, including its copy of the spheres.
  [[nodiscard]] std::size_t byte_count() const noexcept { return static_cast<std::size_t>(byte_count_); }
  // Seconds from the full buffers to the committed scene.
  [[nodiscard]] double build_seconds() const noexcept { return build_seconds_; }
  // For a refitted scene that is not cubic: returns the seconds from new spheres until rays can be cast.
  double move(std::span<const Vec3f> centres);

 private:
  static bool count_bytes(void* self, ssize_t change, bool after);
  void write_balls(const RoundScene& scene);
  void write_curves(const RoundScene& scene, EmbreeShape shape);
  double commit();

  const int thread_count_;
  ssize_t byte_count_ = 0;
  RTCDevice device_;
  RTCScene scene_;
  RTCGeometry geometry_;
  double build_seconds_ = 0;
};

}  // namespace perfect_bvh::bench
