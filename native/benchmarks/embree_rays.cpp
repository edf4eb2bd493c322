#include "embree_rays.h"

#include <algorithm>
#include <utility>

namespace perfect_bvh::bench {
namespace {

RTCRay embree_ray(const Ray& ray) {
  RTCRay out;
  out.org_x = static_cast<float>(ray.origin.x), out.org_y = static_cast<float>(ray.origin.y);
  out.org_z = static_cast<float>(ray.origin.z), out.tnear = ray.t_min;
  out.dir_x = static_cast<float>(ray.direction.x), out.dir_y = static_cast<float>(ray.direction.y);
  out.dir_z = static_cast<float>(ray.direction.z), out.tfar = ray.t_max;
  out.time = ray.time, out.mask = ~0u, out.id = 0, out.flags = 0;
  return out;
}

void set_lane(RTCRay16& rays, std::size_t lane, const Ray& ray) {
  const RTCRay one = embree_ray(ray);
  rays.org_x[lane] = one.org_x, rays.org_y[lane] = one.org_y, rays.org_z[lane] = one.org_z;
  rays.dir_x[lane] = one.dir_x, rays.dir_y[lane] = one.dir_y, rays.dir_z[lane] = one.dir_z;
  rays.tnear[lane] = one.tnear, rays.tfar[lane] = one.tfar, rays.time[lane] = one.time;
  rays.mask[lane] = one.mask, rays.id[lane] = one.id, rays.flags[lane] = one.flags;
}

void set_arguments(RTCIntersectArguments& closest, RTCOccludedArguments& any, RayUse use) {
  const RTCRayQueryFlags flags = use.is_coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  rtcInitIntersectArguments(&closest);
  rtcInitOccludedArguments(&any);
  closest.flags = any.flags = flags;
}

}  // namespace

EmbreeRays::EmbreeRays(std::shared_ptr<const void> owner, RTCScene scene, EmbreeInstanceIds ids)
    : owner_(std::move(owner)), scene_(scene), ids_(ids) {}

void EmbreeRays::load(std::span<const Ray> rays, RayUse use) {
  use_ = use;
  set_arguments(closest_, any_, use);
  if (use.is_any_hit) {
    rays_.resize(rays.size());
    std::transform(rays.begin(), rays.end(), rays_.begin(), embree_ray);
    return;
  }
  queries_.resize(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    queries_[i].ray = embree_ray(rays[i]);
    queries_[i].hit.geomID = queries_[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  }
}

void EmbreeRays::cast() {
  const EmbreeFloatingPoint mode;
  if (use_.is_any_hit) {
    for (RTCRay& ray : rays_) rtcOccluded1(scene_, &ray, &any_);
  } else {
    for (RTCRayHit& query : queries_) rtcIntersect1(scene_, &query, &closest_);
  }
}

void EmbreeRays::read(std::span<Hit> hits) const {
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const RTCHit& hit = queries_[i].hit;
    hits[i] = Hit{};
    if (hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    std::uint32_t instance = 0;
    if (ids_ == EmbreeInstanceIds::kGeometry) instance = hit.instID[0];
    if (ids_ == EmbreeInstanceIds::kRow) instance = hit.instPrimID[0];
    if (ids_ == EmbreeInstanceIds::kEither) {
      instance = hit.instID[0] == RTC_INVALID_GEOMETRY_ID ? hit.geomID : hit.instID[0];
    }
    hits[i] = {queries_[i].ray.tfar, hit.u, hit.v, instance, hit.primID};
  }
}

void EmbreeRays::read(std::span<std::uint8_t> occluded) const {
  for (std::size_t i = 0; i < occluded.size(); ++i) occluded[i] = rays_[i].tfar < 0 ? 1 : 0;
}

EmbreePackets::EmbreePackets(std::shared_ptr<const void> owner, RTCScene scene)
    : owner_(std::move(owner)), scene_(scene) {}

void EmbreePackets::load(std::span<const Ray> rays, RayUse use) {
  use_ = use;
  set_arguments(closest_, any_, use);
  const std::size_t packet_count = (rays.size() + kWidth - 1) / kWidth;
  valid_.resize(packet_count);
  if (use.is_any_hit) {
    rays_.resize(packet_count);
  } else {
    queries_.resize(packet_count);
  }
  for (std::size_t i = 0; i < packet_count * kWidth; ++i) {
    const std::size_t packet = i / kWidth, lane = i % kWidth;
    valid_[packet].lanes[lane] = i < rays.size() ? -1 : 0;
    set_lane(use.is_any_hit ? rays_[packet] : queries_[packet].ray, lane, rays[std::min(i, rays.size() - 1)]);
    if (use.is_any_hit) continue;
    queries_[packet].hit.geomID[lane] = queries_[packet].hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
  }
}

void EmbreePackets::cast() {
  const EmbreeFloatingPoint mode;
  for (std::size_t i = 0; i < valid_.size(); ++i) {
    if (use_.is_any_hit) {
      rtcOccluded16(valid_[i].lanes, scene_, &rays_[i], &any_);
    } else {
      rtcIntersect16(valid_[i].lanes, scene_, &queries_[i], &closest_);
    }
  }
}

void EmbreePackets::read(std::span<Hit> hits) const {
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const RTCRayHit16& query = queries_[i / kWidth];
    const std::size_t lane = i % kWidth;
    const bool found = query.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID;
    hits[i] =
        found ? Hit{query.ray.tfar[lane], query.hit.u[lane], query.hit.v[lane], 0, query.hit.primID[lane]} : Hit{};
  }
}

void EmbreePackets::read(std::span<std::uint8_t> occluded) const {
  for (std::size_t i = 0; i < occluded.size(); ++i) occluded[i] = rays_[i / kWidth].tfar[i % kWidth] < 0 ? 1 : 0;
}

}  // namespace perfect_bvh::bench
