// Embree's rays as competitors, each in the format and the floating-point mode that its manual asks for: RTCRayHit and
// RTCRay one by one, traced in place, or RTCRayHit16 and RTCRay16 filled before.
#pragma once

#include <embree4/rtcore.h>

#include <memory>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "ray_caster.h"

namespace perfect_bvh::bench {

// Flushes denormals to zero and takes them for zero, which Embree's manual asks for in every thread that calls it, as
// long as this stands. The manual speaks of x86 alone.
class EmbreeFloatingPoint {
 public:
#if defined(__x86_64__)
  EmbreeFloatingPoint() noexcept : saved_(_mm_getcsr()) {
    _mm_setcsr(saved_ | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON);
  }
  ~EmbreeFloatingPoint() { _mm_setcsr(saved_); }
#else
  EmbreeFloatingPoint() noexcept {}
  ~EmbreeFloatingPoint() {}
#endif
  EmbreeFloatingPoint(const EmbreeFloatingPoint&) = delete;
  EmbreeFloatingPoint& operator=(const EmbreeFloatingPoint&) = delete;

#if defined(__x86_64__)
 private:
  const unsigned saved_;
#endif
};

// By what a hit's instance is known: nothing, the geometry that it is, a row of an array of instances; or the geometry
// that it is or, without an instance, that was hit.
enum class EmbreeInstanceIds { kNone, kGeometry, kRow, kEither };

// rtcIntersect1 and rtcOccluded1.
class EmbreeRays : public RayCaster {
 public:
  // owner: whatever keeps the scene alive.
  EmbreeRays(std::shared_ptr<const void> owner, RTCScene scene, EmbreeInstanceIds ids = EmbreeInstanceIds::kNone);

  void load(std::span<const Ray> rays, RayUse use) override;
  void cast() override;
  void read(std::span<Hit> hits) const override;
  void read(std::span<std::uint8_t> occluded) const override;

 private:
  const std::shared_ptr<const void> owner_;
  const RTCScene scene_;
  const EmbreeInstanceIds ids_;
  RTCIntersectArguments closest_{};
  RTCOccludedArguments any_{};
  RayUse use_;
  std::vector<RTCRayHit> queries_;
  std::vector<RTCRay> rays_;  // of any hit
};

// rtcIntersect16 and rtcOccluded16 on consecutive rays; of the last ones some are not valid.
class EmbreePackets : public RayCaster {
 public:
  EmbreePackets(std::shared_ptr<const void> owner, RTCScene scene);

  void load(std::span<const Ray> rays, RayUse use) override;
  void cast() override;
  void read(std::span<Hit> hits) const override;
  void read(std::span<std::uint8_t> occluded) const override;

 private:
  static constexpr std::size_t kWidth = 16;
  struct alignas(64) Valid {
    int lanes[kWidth];
  };

  const std::shared_ptr<const void> owner_;
  const RTCScene scene_;
  RTCIntersectArguments closest_{};
  RTCOccludedArguments any_{};
  RayUse use_;
  std::vector<Valid> valid_;
  std::vector<RTCRayHit16> queries_;
  std::vector<RTCRay16> rays_;  // of any hit
};

}  // namespace perfect_bvh::bench
