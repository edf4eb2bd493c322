// Embree's rays as competitors, each in the format and the floating-point mode that its manual requires: RTCRayHit and
// RTCRay one by one, traced in place, or RTCRayHit16 and RTCRay16, filled in advance.
#pragma once

#include <embree4/rtcore.h>

#include <memory>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "ray_caster.h"

namespace perfect_bvh::bench {

// Flushes denormals to zero and reads them as zero during its lifetime. Embree's manual requires this in every thread
// that calls Embree, on x86 only.
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

// How to read the instance of a hit: none; the instance geometry; a row of an array of instances; or the instance
// geometry or, without one, the hit geometry.
enum class EmbreeInstanceIds { kNone, kGeometry, kRow, kEither };

// Uses rtcIntersect1 and rtcOccluded1.
class EmbreeRays : public RayCaster {
 public:
  // owner: the object that keeps the scene alive.
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
  std::vector<RTCRay> rays_;  // for any hit
};

// Uses rtcIntersect16 and rtcOccluded16 on consecutive rays; the last packet may hold invalid rays.
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
  std::vector<RTCRay16> rays_;  // for any hit
};

}  // namespace perfect_bvh::bench
