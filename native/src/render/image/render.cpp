#include "render/image/render.h"

#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "core/errors.h"
#include "core/thread_pool.h"
#include "render/image/tile.h"

namespace perfect_bvh {
namespace {

// Lends each tile a set of used buffers; there are as many as concurrent threads.
class ScratchPool {
 public:
  using Loan = std::unique_ptr<TileScratch>;
  [[nodiscard]] Loan take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<TileScratch>();
    Loan scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  void give_back(Loan scratch) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<Loan> free_;
};

void check(const RenderSettings& settings) {
  constexpr int kLargest = 65536;  // pixels are numbered in 16 bits
  if (settings.width < 1 || settings.height < 1 || settings.width > kLargest || settings.height > kLargest) {
    throw InvalidArgument("render: size must be 1 to 65536 pixels each way, got " + std::to_string(settings.width) +
                          " x " + std::to_string(settings.height));
  }
  if (settings.samples < 1) throw InvalidArgument("render: samples must be at least 1, got 0");
  if (settings.clay.light_rays < 1) throw InvalidArgument("render: light_rays must be at least 1");
  const std::size_t tiles = tile_count(settings.width) * tile_count(settings.height);
  if (!settings.wanted_tiles.empty() && settings.wanted_tiles.size() != tiles) {
    throw InvalidArgument("render: tiles must have one bool for each of the " + std::to_string(tiles) + " tiles, got " +
                          std::to_string(settings.wanted_tiles.size()));
  }
}

}  // namespace

std::vector<SubsetRay> render(const Snapshot& snapshot, const Camera& camera, const Appearance& appearance,
                              const RenderSettings& settings, const PassTargets& targets, CancelToken& cancel) {
  check(settings);
  const ShutterRays shutter(camera, settings.shutter, settings.width, settings.height);
  const RayMaker rays = shutter.camera_at(shutter.middle());
  const PixelRect border = border_pixels(camera, settings.width, settings.height);
  RaySubset kept(settings.kept_share, settings.seed);
  const TileRenderer renderer({snapshot, appearance, rays, settings, cancel}, shutter, border, targets, kept);
  const std::size_t count = renderer.tiles().count();
  cancel.expect(count);

  ScratchPool scratches;
  const auto caller = std::this_thread::get_id();
  const auto poll = [&] {
    if (std::this_thread::get_id() == caller) cancel.poll();
  };
  const auto for_tiles = [&](const auto& work) {
    const auto run = [&](std::size_t begin, std::size_t end) {
      auto scratch = scratches.take();
      for (std::size_t index = begin; index < end; ++index) {
        cancel.throw_if_stopped();
        work(index, *scratch);
      }
      scratches.give_back(std::move(scratch));
    };
    parallel_for(ThreadPool::shared(), count, 1, run, settings.threads, [&] { cancel.poll(); });
  };
  for_tiles([&](std::size_t tile, TileScratch& scratch) {
    renderer.render(tile, scratch, cancel, poll);
    cancel.advance(1);
  });
  if (renderer.needs_finish()) {
    for_tiles([&](std::size_t tile, TileScratch&) { renderer.finish(tile); });
  }
  cancel.throw_if_stopped();
  return kept.take();
}

}  // namespace perfect_bvh
