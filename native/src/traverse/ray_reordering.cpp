#include "traverse/ray_reordering.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace perfect_bvh {
namespace {

constexpr std::size_t kSamples = 128;
constexpr double kLeastCosine = 0.3;            // of a ray to the mean: at larger angles, a plane represents them badly
constexpr double kParallelCosine = 1.0 - 1e-7;  // rays treated as parallel
constexpr double kSamePoint = 0.01;             // in the scene's reach: points treated as one
constexpr std::size_t kCheckedPackets = 16;
constexpr double kCompact = 3.0;  // packets at most this wide, in sides of a square one, are not reordered

struct Point {
  double a, b;
};

// The plane on which rays are laid out: rays close together on it go through the same nodes. Rays through one point are
// projected from that point, parallel rays along their direction.
struct Plane {
  Vec3d along{0, 0, 0}, a{0, 0, 0}, b{0, 0, 0};  // orthonormal
  bool is_perspective = true;

  [[nodiscard]] Point place(const Ray& ray) const noexcept {
    if (!is_perspective) return {dot(ray.origin, a), dot(ray.origin, b)};
    const double share = 1.0 / dot(ray.direction, along);
    return {dot(ray.direction, a) * share, dot(ray.direction, b) * share};
  }
};

// Normalizes a direction of any length.
Vec3d unit(Vec3d d) noexcept { return normalized(d * (1.0 / std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}))); }

struct Range {
  double low = HUGE_VAL, high = -HUGE_VAL;

  void take(double x) noexcept { low = std::min(low, x), high = std::max(high, x); }
  [[nodiscard]] double size() const noexcept { return high - low; }
};

struct Box {
  Range x, y, z;

  void take(Vec3d p) noexcept { x.take(p.x), y.take(p.y), z.take(p.z); }
  [[nodiscard]] double size() const noexcept { return std::max({x.size(), y.size(), z.size()}); }
};

// A sample of the valid rays, spread over all of them at uneven intervals: at the interval of an image's rows, all
// samples would be in one column.
struct Samples {
  std::array<const Ray*, kSamples> rays;
  std::size_t count = 0;

  explicit Samples(std::span<const Ray> all) noexcept {
    for (std::size_t i = 0; i < kSamples; ++i) {
      const std::size_t begin = i * all.size() / kSamples, step = (i + 1) * all.size() / kSamples - begin;
      const Ray& ray = all[begin + (step * ((i * 79) % kSamples)) / kSamples];
      if (is_valid(ray)) rays[count++] = &ray;
    }
  }
  [[nodiscard]] std::span<const Ray* const> all() const noexcept { return {rays.data(), count}; }
};

// Turns the plane's axes so that a is the axis along which the rays spread most. Bands along it are then as long as
// possible, also for the rows of a tilted camera.
void turn_axes(Plane& plane, const Samples& samples) noexcept {
  const auto n = static_cast<double>(samples.count);
  double a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  for (const Ray* ray : samples.all()) {
    const Point p = plane.place(*ray);
    a += p.a, b += p.b, aa += p.a * p.a, ab += p.a * p.b, bb += p.b * p.b;
  }
  const double difference = (aa - a * a / n) - (bb - b * b / n), twice = 2 * (ab - a * b / n);
  const double size = std::sqrt(difference * difference + twice * twice);
  if (!(size > 0)) return;
  // Half the angle of (difference, twice).
  const double cosine = std::sqrt(std::max(0.5 * (1 + difference / size), 0.0));
  const double sine = std::copysign(std::sqrt(std::max(0.5 * (1 - difference / size), 0.0)), twice);
  const Vec3d old = plane.a;
  plane.a = old * cosine + plane.b * sine;
  plane.b = plane.b * cosine - old * sine;
}

// Returns false if the rays neither meet in a point nor are parallel.
bool find_plane(const Samples& samples, double reach, Plane& plane) noexcept {
  if (samples.count < kSamples / 2) return false;
  Vec3d sum{0, 0, 0};
  Box origins, ends;
  for (const Ray* ray : samples.all()) {
    sum = sum + unit(ray->direction);
    origins.take(ray->origin);
    ends.take(ray->origin + ray->direction * static_cast<double>(ray->t_max));
  }
  plane.along = normalized(sum);
  double least = 1.0;
  for (const Ray* ray : samples.all()) {
    const double cosine = dot(unit(ray->direction), plane.along);
    if (!(cosine > kLeastCosine)) return false;
    least = std::min(least, cosine);
  }
  plane.is_perspective = origins.size() <= kSamePoint * reach || ends.size() <= kSamePoint * reach;
  if (!plane.is_perspective && least < kParallelCosine) return false;
  const Vec3d size{std::abs(plane.along.x), std::abs(plane.along.y), std::abs(plane.along.z)};
  const Vec3d across = size.x <= size.y && size.x <= size.z ? Vec3d{1, 0, 0}
                       : size.y <= size.z                   ? Vec3d{0, 1, 0}
                                                            : Vec3d{0, 0, 1};
  plane.a = normalized(cross(plane.along, across));
  plane.b = cross(plane.along, plane.a);
  turn_axes(plane, samples);
  return true;
}

// Divides the plane into bands, one square packet high, and the bands into columns of eight rays. Any 64 consecutive
// rays in this order then roughly form a square. Every other band runs backwards, so that the order does not jump from
// one end to the other.
class Cells {
 public:
  Cells(const Plane& plane, const Samples& samples, std::size_t ray_count) noexcept {
    for (const Ray* ray : samples.all()) {
      const Point p = plane.place(*ray);
      a_.take(p.a), b_.take(p.b);
    }
    const auto count = static_cast<double>(ray_count);
    // Rays in a line form one band, one ray high.
    side_ = std::sqrt(kPacketRays * a_.size() * std::max(b_.size(), a_.size() / count) / count);
    bands_ = std::clamp(std::round(b_.size() / side_), 1.0, std::max(count / (8.0 * 8.0), 1.0));
    columns_ = std::max(std::floor(count / (8.0 * bands_)), 1.0);
    per_a_ = columns_ / a_.size(), per_b_ = b_.size() > 0 ? bands_ / b_.size() : 0.0;
  }

  [[nodiscard]] bool are_usable() const noexcept { return side_ > 0 && per_a_ < HUGE_VAL && per_b_ < HUGE_VAL; }
  [[nodiscard]] std::size_t count() const noexcept { return static_cast<std::size_t>(bands_ * columns_); }
  [[nodiscard]] double side() const noexcept { return side_; }

  // Points outside, or without a valid position, belong to the cells at the edge.
  [[nodiscard]] std::uint32_t of(Point p) const noexcept {
    const std::uint32_t band = index((p.b - b_.low) * per_b_, bands_);
    const std::uint32_t column = index((p.a - a_.low) * per_a_, columns_);
    const auto columns = static_cast<std::uint32_t>(columns_);
    return band * columns + ((band & 1) != 0 ? columns - 1 - column : column);
  }

 private:
  static std::uint32_t index(double place, double count) noexcept {
    return static_cast<std::uint32_t>(std::min(std::max(0.0, place), count - 1.0));
  }

  Range a_, b_;
  double side_ = 0, bands_ = 1, columns_ = 1, per_a_ = 0, per_b_ = 0;
};

// Returns whether most packets of consecutive rays are nearly square already.
bool are_compact(std::span<const Ray> rays, const Plane& plane, double side) noexcept {
  const std::size_t packets = rays.size() / kPacketRays;
  const std::size_t checked = std::min(packets, kCheckedPackets);
  std::size_t compact = 0;
  for (std::size_t i = 0; i < checked; ++i) {
    const Ray* const packet = &rays[i * packets / checked * kPacketRays];
    Range a, b;
    for (unsigned ray = 0; ray < kPacketRays; ray += 9) {  // the diagonal of a tile
      const Point p = plane.place(packet[ray]);
      a.take(p.a), b.take(p.b);
    }
    compact += std::max(a.size(), b.size()) <= kCompact * side ? 1 : 0;
  }
  return 4 * compact >= 3 * checked;
}

}  // namespace

bool reorder_rays(std::span<const Ray> rays, double reach, ReorderingSpace& space) noexcept {
  if (rays.size() < kLeastReordered) return false;
  const Samples samples(rays);
  Plane plane;
  if (!find_plane(samples, reach, plane)) return false;
  const Cells cells(plane, samples, rays.size());
  if (!cells.are_usable() || are_compact(rays, plane, cells.side())) return false;
  // Counting sort.
  std::uint32_t* const firsts = space.firsts;
  std::fill_n(firsts, cells.count() + 1, 0u);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const std::uint32_t cell = cells.of(plane.place(rays[i]));
    space.cells[i] = static_cast<std::uint16_t>(cell);
    ++firsts[cell + 1];
  }
  for (std::size_t cell = 1; cell < cells.count(); ++cell) firsts[cell] += firsts[cell - 1];
  for (std::size_t i = 0; i < rays.size(); ++i) space.order[firsts[space.cells[i]]++] = static_cast<std::uint32_t>(i);
  return true;
}

}  // namespace perfect_bvh
