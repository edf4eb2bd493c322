#include "render/light/emitters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/thread_pool.h"
#include "math/elementary.h"
#include "query/trace.h"
#include "render/light/studio.h"
#include "render/surface/surface.h"

namespace perfect_bvh {
namespace {

// Weaker emission is left to rays that the surface scatters: it makes no specks, and a ray to it costs as much as one
// to a lamp.
constexpr float kLeastBrightness = 10.0f;
constexpr std::size_t kMostTriangles = std::size_t{1} << 18;

Hit hit_on(std::uint32_t instance, std::uint32_t primitive) noexcept {
  Hit hit;
  hit.instance_index = instance, hit.primitive_index = primitive;
  return hit;
}

// The largest area during the motion: a triangle without area at first may shine later.
double largest_area(const Instance& instance, TriangleIndices corners) noexcept {
  const auto area = [&](float time) { return 0.5 * length(place_triangle(instance, corners, time).scaled_normal()); };
  if (instance.motion == 0) return area(0.0f);
  double largest = 0.0;
  constexpr int kTimes = 8;
  for (int i = 0; i <= kTimes; ++i) largest = std::max(largest, area(static_cast<float>(i) / kTimes));
  return largest;
}

}  // namespace

EmissiveTriangles::EmissiveTriangles(const Snapshot& snapshot, const Appearance& appearance)
    : snapshot_(snapshot), appearance_(appearance) {
  const auto glows = [](Vec3f color) { return std::max({color.x, color.y, color.z}) >= kLeastBrightness; };
  if (!std::any_of(appearance.emissions.begin(), appearance.emissions.end(), glows)) return;
  for (std::uint32_t i = 0; i < snapshot.instances.size(); ++i) {
    if (may_emit(snapshot.instances[i]) && !list(i)) {
      triangles_.clear(), powers_.clear();
      return;
    }
  }
}

float EmissiveTriangles::brightness(std::int32_t material) const noexcept {
  const auto row = static_cast<std::size_t>(material);
  const Vec3f color = appearance_.emissions[row];
  const float alpha = appearance_.alphas.empty() ? 1.0f : appearance_.alphas[row];
  const float bright = std::max({color.x, color.y, color.z}) * alpha;
  return bright >= kLeastBrightness ? bright : 0.0f;
}

bool EmissiveTriangles::may_emit(const Instance& instance) const noexcept {
  if (instance.blas->mesh.is_round()) return false;  // rays find their light by hitting them
  const std::int32_t row = appearance_.row_of(instance);
  if (row < 0 || (instance.mask & appearance_.diffuse_mask) == 0) return false;
  const auto index = static_cast<std::size_t>(row);
  const auto slots = appearance_.slot_materials.subspan(
      static_cast<std::size_t>(appearance_.slot_offsets[index]),
      static_cast<std::size_t>(appearance_.slot_offsets[index + 1] - appearance_.slot_offsets[index]));
  return std::any_of(slots.begin(), slots.end(),
                     [&](std::int32_t material) { return material != kNoMaterial && brightness(material) > 0.0f; });
}

bool EmissiveTriangles::list(std::uint32_t instance_index) {
  const Instance& instance = snapshot_.instances[instance_index];
  const auto count = static_cast<std::uint32_t>(instance.blas->mesh.primitive_count());
  for (std::uint32_t primitive = 0; primitive < count; ++primitive) {
    const std::int32_t material = appearance_.material_of(instance, primitive);
    if (material == kNoMaterial || !(brightness(material) > 0.0f)) continue;
    const double area = largest_area(instance, instance.blas->mesh.triangles[primitive]);
    const double power = area * static_cast<double>(brightness(material));
    if (!(power > 0.0) || !std::isfinite(power)) continue;
    if (triangles_.size() == kMostTriangles) return false;
    powers_.push_back((powers_.empty() ? 0.0 : powers_.back()) + power);
    triangles_.push_back({instance_index, primitive, static_cast<float>(area)});
  }
  return true;
}

// A triangle smaller than its listed area is chosen too often, and its light is reduced accordingly.
EmissivePoint EmissiveTriangles::choose(float pick, Point2 place, float time) const {
  const auto found = std::upper_bound(powers_.begin(), powers_.end() - 1, static_cast<double>(pick) * power());
  const Triangle& triangle = triangles_[static_cast<std::size_t>(found - powers_.begin())];
  Hit hit = hit_on(triangle.instance, triangle.primitive);
  // Uniform over the triangle.
  const float rest = std::sqrt(place.x);
  hit.u = 1.0f - rest, hit.v = place.y * rest;
  const Instance& instance = snapshot_.instances[triangle.instance];
  const std::int32_t row = appearance_.material_of(instance, triangle.primitive);
  const Vec3d normal = world_triangle(snapshot_, hit, time).scaled_normal();
  const Material material = material_at(snapshot_, appearance_, ray_onto(snapshot_, hit, time), hit, row);
  const float growth = instance.motion == 0 ? 1.0f : static_cast<float>(0.5 * length(normal)) / triangle.area;
  return {hit_position(snapshot_, hit, time), to_float(normalized(normal)),
          material.emission * (material.alpha * growth), density(instance, row), instance.mask};
}

// Environment ---------------------------------------------------------------------------------------------------------

namespace {

constexpr float kBright = 4.0f;  // times the mean: darker light makes no specks when surfaces' rays find it
constexpr int kMostColumns = 2048;
constexpr double kPi = std::numbers::pi;

// A colour that is not finite counts as black: one such pixel would determine the mean of all.
Vec3f color_of(const Rgba& pixel) noexcept {
  return std::isfinite(pixel.r + pixel.g + pixel.b) ? Vec3f{pixel.r, pixel.g, pixel.b} : Vec3f{0, 0, 0};
}

float largest(Vec3f color) noexcept { return std::max({color.x, color.y, color.z}); }

// The parts of a pixel's light for itself and for each neighbour, along one axis, under bilinear lookup.
float tent(int step) noexcept { return step == 0 ? 0.75f : 0.125f; }

Vec3f turned(Vec3f direction, float angle) noexcept {
  const auto [s, c] = sine_cosine(angle);
  return {direction.x * c - direction.y * s, direction.x * s + direction.y * c, direction.z};
}

}  // namespace

struct BrightSky::Strip {
  double weight;  // its solid angle, over that of a sphere
  Vec3d mean;     // of its colours
  float brightest;
};

BrightSky::BrightSky(const Texture& image, int threads)
    : width_(image.width), height_(image.height), is_sky_(image.extension == Extension::kSky) {
  if (width_ < 1 || height_ < 1) return;
  std::vector<Strip> strips(static_cast<std::size_t>(height_));
  const auto sum_rows = [&](std::size_t begin, std::size_t end) {
    std::vector<Rgba> buffer;
    for (std::size_t y = begin; y < end; ++y) {
      strips[y] = sum(row_of_pixels(image, static_cast<int>(y), buffer), static_cast<int>(y));
    }
  };
  parallel_for(ThreadPool::shared(), strips.size(), 16, sum_rows, threads);
  Vec3d mean{0, 0, 0};
  for (const Strip& strip : strips) mean = mean + strip.mean * strip.weight;
  mean_plain_ = to_float(mean);
  most_plain_ = kBright * largest(mean_plain_);
  if (!(most_plain_ > 0.0f) || !std::isfinite(most_plain_)) {
    most_plain_ = std::numeric_limits<float>::infinity();  // black, or broken: nothing to sample
    return;
  }
  cell_ = (width_ + kMostColumns - 1) / kMostColumns;
  columns_ = (width_ + cell_ - 1) / cell_;
  list(spread(image, strips));
}

// Returns the sine of the latitude of a row's lower border.
double BrightSky::height_at(double row) const noexcept {
  const double up = std::clamp(row / height_, 0.0, 1.0) - 0.5;
  return sine(kPi * (is_sky_ ? 2.0 * up * std::abs(up) : up));
}

BrightSky::Parts BrightSky::split(Vec3f color) const noexcept {
  const float brightest = largest(color);
  if (!(brightest > most_plain_)) return {color, {0, 0, 0}};
  const Vec3f plain = color * (most_plain_ / brightest);
  return {plain, color - plain};
}

BrightSky::Strip BrightSky::sum(std::span<const Rgba> pixels, int y) const noexcept {
  Vec3f total{0, 0, 0}, most{0, 0, 0};
  for (const Rgba& pixel : pixels) {
    const Vec3f color{pixel.r, pixel.g, pixel.b};
    total = total + color, most = max(most, color);
  }
  if (!std::isfinite(total.x + total.y + total.z)) {
    total = most = {0, 0, 0};
    for (const Rgba& pixel : pixels) total = total + color_of(pixel), most = max(most, color_of(pixel));
  }
  return {0.5 * (height_at(y + 1) - height_at(y)), to_double(total) * (1.0 / width_), largest(most)};
}

// Sums the bright part of the image over the pixels of each cell, and subtracts it from the mean of the rest.
std::vector<float> BrightSky::spread(const Texture& image, const std::vector<Strip>& strips) {
  const int rows = (height_ + cell_ - 1) / cell_;
  const auto columns = static_cast<std::size_t>(columns_);
  std::vector<float> light(static_cast<std::size_t>(rows) * columns, 0.0f);
  std::vector<std::size_t> column_of(static_cast<std::size_t>(width_) + 2);  // from the pixel before the first on
  for (int x = -1; x <= width_; ++x) {
    column_of[static_cast<std::size_t>(x + 1)] = static_cast<std::size_t>((x + width_) % width_ / cell_);
  }
  std::vector<Rgba> buffer;
  Vec3d bright{0, 0, 0};
  for (int y = 0; y < height_; ++y) {
    const Strip& strip = strips[static_cast<std::size_t>(y)];
    if (!(strip.brightest > most_plain_)) continue;
    const std::span<const Rgba> pixels = row_of_pixels(image, y, buffer);
    for (std::size_t x = 0; x < pixels.size(); ++x) {
      if (!(std::max({pixels[x].r, pixels[x].g, pixels[x].b}) > most_plain_)) continue;
      const Vec3f part = split(color_of(pixels[x])).bright;
      const float excess = largest(part);
      bright = bright + to_double(part) * (strip.weight / width_);
      for (int dy = -1; dy <= 1; ++dy) {
        const std::size_t first = static_cast<std::size_t>(std::clamp(y + dy, 0, height_ - 1) / cell_) * columns;
        for (int dx = -1; dx <= 1; ++dx) {
          light[first + column_of[x + static_cast<std::size_t>(dx + 1)]] += excess * tent(dx) * tent(dy);
        }
      }
    }
  }
  mean_plain_ = max(mean_plain_ - to_float(bright), Vec3f{0, 0, 0});
  return light;
}

void BrightSky::list(const std::vector<float>& light) {
  const auto columns = static_cast<std::size_t>(columns_);
  double sum = 0.0;
  for (std::size_t row = 0; row * columns < light.size(); ++row) {
    const int first = static_cast<int>(row) * cell_, end = std::min(first + cell_, height_);
    const double height = height_at(end) - height_at(first);
    const auto first_cell = static_cast<std::uint32_t>(cells_.size());
    for (std::size_t column = 0; column < columns; ++column) {
      const float value = light[row * columns + column];
      if (!(value > 0.0f)) continue;
      const int left = static_cast<int>(column) * cell_, wide = std::min(left + cell_, width_) - left;
      const float mean = value / static_cast<float>(wide * (end - first));
      sum += static_cast<double>(mean) * (2.0 * kPi * wide / width_) * height;
      cells_.push_back({static_cast<std::uint32_t>(column), mean, sum});
    }
    const auto end_cell = static_cast<std::uint32_t>(cells_.size());
    if (end_cell > first_cell) rows_.push_back({static_cast<std::uint32_t>(row), first_cell, end_cell, sum});
  }
}

BrightSky::Choice BrightSky::choose(Point2 random) const noexcept {
  const double wanted = static_cast<double>(random.y) * total();
  const auto row = std::upper_bound(rows_.begin(), rows_.end() - 1, wanted,
                                    [](double value, const Row& each) { return value < each.total; });
  const double before = row == rows_.begin() ? 0.0 : (row - 1)->total;
  const double up = (wanted - before) / (row->total - before);
  const double wanted_here = before + static_cast<double>(random.x) * (row->total - before);
  const auto first = cells_.begin() + row->first, end = cells_.begin() + row->end;
  const auto cell =
      std::upper_bound(first, end - 1, wanted_here, [](double value, const Cell& each) { return value < each.total; });
  const double before_cell = cell == first ? before : (cell - 1)->total;
  const double along = (wanted_here - before_cell) / (cell->total - before_cell);
  const double left = static_cast<double>(cell->column) * cell_, right = std::min(left + cell_, 1.0 * width_);
  const double low = height_at(static_cast<double>(row->number) * cell_);
  const double high = height_at((static_cast<double>(row->number) + 1.0) * cell_);
  const double z = low + (high - low) * up;
  // As in look_up_around.
  const double angle = (0.5 - (left + (right - left) * along) / width_) * 2.0 * kPi;
  const double flat = std::sqrt(std::max(0.0, 1.0 - z * z));
  const auto [sine, cosine] = sine_cosine(angle);
  return {to_float(Vec3d{flat * cosine, flat * sine, z}), cell->light / static_cast<float>(total())};
}

float BrightSky::density(Vec3f direction) const noexcept {
  if (empty()) return 0.0f;
  const Point2 place = place_around(direction, is_sky_);
  const auto cell_at = [this](float share, int pixels) {
    const int pixel = std::clamp(static_cast<int>(share * static_cast<float>(pixels)), 0, pixels - 1);
    return static_cast<std::uint32_t>(pixel / cell_);
  };
  const std::uint32_t row_number = cell_at(place.y, height_), column = cell_at(place.x, width_);
  const auto row = std::lower_bound(rows_.begin(), rows_.end(), row_number,
                                    [](const Row& each, std::uint32_t number) { return each.number < number; });
  if (row == rows_.end() || row->number != row_number) return 0.0f;
  const auto end = cells_.begin() + row->end;
  const auto cell = std::lower_bound(cells_.begin() + row->first, end, column,
                                     [](const Cell& each, std::uint32_t number) { return each.column < number; });
  return cell == end || cell->column != column ? 0.0f : cell->light / static_cast<float>(total());
}

Environment::Environment(const Appearance& appearance, int threads)
    : appearance_(appearance), bright_(find_bright_sky(threads)), mean_(find_mean()) {}

const Texture* Environment::image() const noexcept {
  const bool any = appearance_.world && appearance_.world->image != kNoImage;
  return any ? &appearance_.images[static_cast<std::size_t>(appearance_.world->image)] : nullptr;
}

std::shared_ptr<const BrightSky> Environment::find_bright_sky(int threads) const {
  if (!image()) return std::make_shared<const BrightSky>();
  return appearance_.bright_sky ? appearance_.bright_sky : std::make_shared<const BrightSky>(*image(), threads);
}

Vec3f Environment::radiance(Vec3f direction) const noexcept {
  if (!appearance_.world) return Studio::dome(direction.z);
  const World& world = *appearance_.world;
  return image() ? look_up_around(*image(), turned(direction, world.rotation)) * world.color : world.color;
}

Vec3f Environment::backdrop(Vec3f direction) const noexcept {
  if (!appearance_.backdrop) return radiance(direction);
  const World& seen = *appearance_.backdrop;
  if (seen.image == kNoImage) return seen.color;
  const Texture& shown = appearance_.images[static_cast<std::size_t>(seen.image)];
  return look_up_around(shown, turned(direction, seen.rotation)) * seen.color;
}

BrightSky::Parts Environment::parts(Vec3f direction) const noexcept {
  if (!can_be_aimed_at()) return {radiance(direction), {0, 0, 0}};
  const World& world = *appearance_.world;
  const BrightSky::Parts parts = bright_->split(look_up_around(*image(), turned(direction, world.rotation)));
  return {parts.plain * world.color, parts.bright * world.color};
}

BrightSky::Choice Environment::aim(Point2 random) const noexcept {
  const BrightSky::Choice choice = bright_->choose(random);
  return {turned(choice.direction, -appearance_.world->rotation), choice.density};
}

float Environment::density(Vec3f direction) const noexcept {
  return bright_->density(turned(direction, appearance_.world->rotation));
}

Vec3f Environment::find_mean() const noexcept {
  if (image()) return bright_->mean_plain() * appearance_.world->color;
  if (appearance_.world) return appearance_.world->color;
  constexpr std::uint32_t kDirections = 64;
  Vec3f sum{0, 0, 0};
  for (std::uint32_t i = 0; i < kDirections; ++i) {
    const Point2 random = sampling::scrambled_sobol(i, 0).to_unit();
    sum = sum + Studio::dome(2.0f * random.x - 1.0f);
  }
  return sum * (1.0f / static_cast<float>(kDirections));
}

}  // namespace perfect_bvh
