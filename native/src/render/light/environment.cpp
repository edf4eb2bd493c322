#include "render/light/environment.h"

#include <algorithm>

#include "math/elementary.h"
#include "render/light/studio.h"

namespace perfect_bvh {
namespace {

Vec3f turned(Vec3f direction, float angle) noexcept {
  const auto [s, c] = sine_cosine(angle);
  return {direction.x * c - direction.y * s, direction.x * s + direction.y * c, direction.z};
}

}  // namespace

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
