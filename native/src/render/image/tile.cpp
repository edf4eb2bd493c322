#include "render/image/tile.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "render/sampling/sampler.h"

namespace perfect_bvh {

RaySubset::RaySubset(float share, std::uint32_t seed) noexcept
    : limit_(static_cast<std::uint64_t>(static_cast<double>(share) * 0x1p32)),
      seed_(sampling::mix(seed ^ 0x5bd1e995u)) {}

void RaySubset::offer(const Snapshot& snapshot, std::uint32_t sample, std::span<const Pixel> pixels,
                      std::span<const Ray> rays, std::span<const Hit> hits) {
  if (limit_ == 0) return;
  std::vector<SubsetRay> chosen;
  const std::uint32_t salt = sampling::mix(seed_ + sample);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (sampling::mix(salt ^ sampling::z_order(pixels[i].x, pixels[i].y)) >= limit_) continue;
    const Hit& hit = hits[i];
    SubsetRay& kept = chosen.emplace_back();
    kept = {pixels[i], sample, rays[i], std::numeric_limits<float>::infinity(), -1, -1};
    if (!hit.found()) continue;
    kept.t = hit.t;
    kept.instance_id = snapshot.instances[hit.instance_index].id;
    kept.primitive_id = static_cast<std::int32_t>(hit.primitive_index);
  }
  const std::lock_guard lock(mutex_);
  kept_.insert(kept_.end(), chosen.begin(), chosen.end());
}

std::vector<SubsetRay> RaySubset::take() {
  const auto place = [](const SubsetRay& kept) { return std::tuple(kept.pixel.y, kept.pixel.x, kept.sample); };
  std::sort(kept_.begin(), kept_.end(), [&](const SubsetRay& a, const SubsetRay& b) { return place(a) < place(b); });
  return std::move(kept_);
}

// Tile ----------------------------------------------------------------------------------------------------------------

TileRenderer::TileRenderer(const ModeInputs& inputs, const ShutterRays& shutter, PixelRect border,
                           const PassTargets& targets, RaySubset& kept)
    : inputs_(inputs),
      shutter_(shutter),
      targets_(targets),
      kept_(kept),
      mode_(make_mode(inputs)),
      filter_(inputs.settings.filter_width),
      filter_dimension_(inputs.settings.seed, 0),
      lens_dimension_(inputs.settings.seed, 1),
      time_dimension_(inputs.settings.seed, 2),
      pass_needs_{.normals = !targets.normal.empty(),
                  .materials = !targets.normal.empty() && inputs.appearance.bends_normals()},
      sample_needs_(mode_->needs() | SurfaceNeeds{.normals = targets.any_guides(), .materials = targets.any_guides()}),
      sample_count_(mode_->is_exact() ? 1 : inputs.settings.samples),
      centred_(mode_->is_exact() ||
               (sample_count_ == 1 && inputs.settings.first_sample == 0 && !inputs.settings.is_continued)),
      has_lens_(mode_->is_photograph() && inputs.camera.lens().has_value()),
      has_shutter_(mode_->is_photograph() && shutter.blurs()),
      border_(border),
      tiles_(border.grown(shared_reach(), inputs.settings.width, inputs.settings.height)),
      wants_centres_(targets.any_surface() || targets.any_counts()) {
  if (shared_reach() > 0 && !targets.combined.empty()) film_.emplace(tiles_, filter_, are_apart());
}

// Returns whether a pixel is in a requested tile, or has samples that count in one. They reach no farther than a tile's
// width, so the corners of their reach are in all the tiles that they reach.
bool TileRenderer::is_needed(int x, int y) const noexcept {
  if (is_wanted(x, y)) return true;
  const int reach = film_ ? filter_.reach() : 0;
  if (reach == 0) return false;
  const int left = std::max(x - reach, 0), right = std::min(x + reach, inputs_.settings.width - 1);
  const int top = std::max(y - reach, 0), bottom = std::min(y + reach, inputs_.settings.height - 1);
  return is_wanted(left, top) || is_wanted(right, top) || is_wanted(left, bottom) || is_wanted(right, bottom);
}

// Pixels are in Z-order, so that neighbouring rays of a batch are neighbours in the image in both directions. The order
// is always that of the whole tile, even if only a part is rendered, because sums depend on it.
void TileRenderer::place_pixels(std::size_t tile, TileScratch& scratch) const {
  const PixelRect whole = tiles_.whole_at(tile), part = tiles_.at(tile);
  scratch.pixels.clear();
  for (std::uint32_t place = 0; place < kTileSize * kTileSize; ++place) {
    const auto even_bits = [](std::uint32_t bits) {
      std::uint32_t result = 0;
      for (std::uint32_t i = 0; (1u << i) < kTileSize; ++i) result |= ((bits >> (2 * i)) & 1u) << i;
      return static_cast<int>(result);
    };
    const int x = whole.x0 + even_bits(place), y = whole.y0 + even_bits(place >> 1);
    if (part.contains(x, y) && is_needed(x, y)) {
      scratch.pixels.push_back({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)});
    }
  }
  scratch.places.resize(scratch.pixels.size());
  std::transform(scratch.pixels.begin(), scratch.pixels.end(), scratch.places.begin(), [this](Pixel pixel) {
    const std::uint32_t place = sampling::z_order(pixel.x, pixel.y);
    return are_apart() ? sampling::mix(place) : place;
  });
  scratch.rays.resize(scratch.pixels.size());
  scratch.hits.resize(scratch.pixels.size());
}

void TileRenderer::begin(std::size_t tile, TileScratch& scratch) const {
  const std::size_t count = scratch.pixels.size();
  scratch.sums.assign(count, Rgba{});
  if (targets_.any_guides()) {
    scratch.albedo_sums.assign(count, Vec3f{0, 0, 0}), scratch.normal_sums.assign(count, Vec3f{0, 0, 0});
  }
  if (film_) film_->begin(tile);
}

void TileRenderer::trace(TileScratch& scratch, std::uint32_t sample, bool with_counts) const {
  scratch.counts.assign(with_counts ? scratch.rays.size() : 0, RayCounts{});
  trace_closest(inputs_.snapshot, inputs_.cancel, scratch.rays, scratch.hits, Cull::kNone, scratch.counts);
  kept_.offer(inputs_.snapshot, sample, scratch.pixels, scratch.rays, scratch.hits);
}

void TileRenderer::trace_centres(TileScratch& scratch) const {
  for (std::size_t i = 0; i < scratch.pixels.size(); ++i) {
    const Pixel pixel = scratch.pixels[i];
    scratch.rays[i] =
        inputs_.camera.through(pixel.x + 0.5, pixel.y + 0.5, inputs_.appearance.camera_mask, shutter_.middle());
  }
  trace(scratch, inputs_.settings.first_sample, targets_.any_counts() || (shades_centres() && mode_->wants_counts()));
  store_centres(scratch);
}

void TileRenderer::store_centres(TileScratch& scratch) const {
  const Appearance& appearance = inputs_.appearance;
  const auto store = [&](const auto& rays, const auto& hits, SurfaceNeeds needs) {
    scratch.points.clear();
    find_surfaces(inputs_.snapshot, appearance, needs, rays, hits, scratch.points);
    if (pass_needs_.materials) scratch.materials.read(inputs_.snapshot, appearance, rays, hits, scratch.points);
    store_passes(targets_, inputs_.snapshot, appearance, shutter_, border_, inputs_.settings.width,
                 {scratch.pixels, rays, hits, scratch.counts, scratch.points});
  };
  if (!(appearance.pass_alpha_threshold > 0.0f && appearance.any_transparent() && targets_.any_surface())) {
    return store(scratch.rays, scratch.hits, shades_centres() ? pass_needs_ | sample_needs_ : pass_needs_);
  }
  scratch.pass_rays = scratch.rays, scratch.pass_hits = scratch.hits;
  look_through(inputs_.snapshot, appearance, inputs_.settings.light_paths.transparent_bounces, inputs_.cancel,
               scratch.pass_rays, scratch.pass_hits);
  store(scratch.pass_rays, scratch.pass_hits, pass_needs_);
  scratch.points.clear();
  if (!shades_centres()) return;
  find_surfaces(inputs_.snapshot, appearance, sample_needs_, scratch.rays, scratch.hits, scratch.points);
}

void TileRenderer::make_rays(std::uint32_t sample, TileScratch& scratch) const {
  const FixedPoint2 point = filter_dimension_.sample(sample), on_lens = lens_dimension_.sample(sample);
  const FixedPoint2 chance = time_dimension_.sample(sample);
  scratch.offsets.assign(scratch.pixels.size(), Point2{0.0f, 0.0f});
  for (std::size_t i = 0; i < scratch.pixels.size(); ++i) {
    const Pixel pixel = scratch.pixels[i];
    Point2& offset = scratch.offsets[i];
    if (!centred_) {
      const FixedPoint2 shift = filter_dimension_.offset(scratch.places[i]);
      const Point2 random = (point ^ shift).to_unit();
      offset = film_ ? Point2{random.x - 0.5f, random.y - 0.5f} : filter_.offset(random);
    }
    const double x = pixel.x + 0.5 + static_cast<double>(offset.x), y = pixel.y + 0.5 + static_cast<double>(offset.y);
    float time = shutter_.middle();
    if (has_shutter_) {
      time = shutter_.time_at((chance ^ time_dimension_.offset(scratch.places[i])).to_unit().x, pixel.y);
    }
    const auto cast_from = [&](const RayMaker& camera) {
      Ray& ray = scratch.rays[i] = camera.through(x, y, inputs_.appearance.camera_mask, time);
      if (!has_lens_) return;
      camera.bend(ray, camera.lens()->point((on_lens ^ lens_dimension_.offset(scratch.places[i])).to_unit()));
    };
    if (has_shutter_ && shutter_.camera_moves()) {
      cast_from(shutter_.camera_at(time));
    } else {
      cast_from(inputs_.camera);
    }
  }
}

void TileRenderer::add_sample(std::uint32_t sample, std::size_t tile, TileScratch& scratch) const {
  const std::uint32_t number = inputs_.settings.first_sample + sample;
  if (!shades_centres()) {
    make_rays(number, scratch);
    trace(scratch, number, mode_->wants_counts());
    scratch.points.clear();
    find_surfaces(inputs_.snapshot, inputs_.appearance, sample_needs_, scratch.rays, scratch.hits, scratch.points);
  }
  fill_background(scratch);
  const std::size_t guided = targets_.any_guides() ? scratch.pixels.size() : 0;
  scratch.albedos.assign(guided, Vec3f{0, 0, 0}), scratch.normals.assign(guided, Vec3f{0, 0, 0});
  mode_->shade({number, scratch.places, scratch.rays, scratch.hits, scratch.counts, scratch.points, scratch.colors,
                scratch.albedos, scratch.normals, scratch.shade});
  if (guided > 0) add_guides(scratch);
  if (film_) film_->add(tile, scratch.pixels, scratch.offsets, scratch.colors, scratch.albedos, scratch.normals);
  if (film_ && !are_apart()) return;
  for (std::size_t i = 0; i < scratch.sums.size(); ++i) {
    Rgba& sum = scratch.sums[i];
    const Rgba& color = scratch.colors[i];
    sum = {sum.r + color.r, sum.g + color.g, sum.b + color.b, sum.a + color.a};
  }
}

void TileRenderer::add_guides(TileScratch& scratch) const {
  if (!mode_->has_guides()) {
    for (const SurfacePoint& point : scratch.points) {
      scratch.albedos[point.ray] = inputs_.settings.clay.color.value_or(point.color);
      scratch.normals[point.ray] = point.light_normal;
    }
  }
  if (film_) return;
  for (std::size_t i = 0; i < scratch.albedos.size(); ++i) {
    scratch.albedo_sums[i] = scratch.albedo_sums[i] + scratch.albedos[i];
    scratch.normal_sums[i] = scratch.normal_sums[i] + scratch.normals[i];
  }
}

// Holdouts have no colour and alpha: they also cut through the backdrop.
void TileRenderer::fill_background(TileScratch& scratch) const {
  scratch.colors.assign(scratch.pixels.size(), Rgba{});
  if (!mode_->has_backdrop() || inputs_.appearance.film_transparent) return;
  const float scale_x = 1.0f / static_cast<float>(inputs_.settings.width);
  const float scale_y = 1.0f / static_cast<float>(inputs_.settings.height);
  for (std::size_t i = 0; i < scratch.pixels.size(); ++i) {
    if (scratch.hits[i].found()) continue;
    const Pixel pixel = scratch.pixels[i];
    const Vec3f color =
        mode_->backdrop(scratch.rays[i], static_cast<float>(pixel.x) * scale_x, static_cast<float>(pixel.y) * scale_y);
    scratch.colors[i] = {color.x, color.y, color.z, 1.0f};
  }
}

// Stores the means of pixels' own samples: for pixels of the film, the denoiser's input; for others, everything.
void TileRenderer::store_own(const TileScratch& scratch) const {
  const float share = 1.0f / static_cast<float>(sample_count_);
  for (std::size_t i = 0; i < scratch.pixels.size(); ++i) {
    const auto [x, y] = scratch.pixels[i];
    if (!border_.contains(x, y) || !is_wanted(x, y)) continue;  // these only count on the film
    const Rgba& sum = scratch.sums[i];
    const Rgba mean{sum.r * share, sum.g * share, sum.b * share, sum.a * share};
    const std::size_t row = row_of(scratch.pixels[i]);
    if (are_apart()) targets_.denoising_color[row] = mean;
    if (film_) continue;
    targets_.combined[row] = mean;
    if (!are_apart()) continue;
    targets_.denoising_albedo[row] = scratch.albedo_sums[i] * share;
    targets_.denoising_normal[row] = scratch.normal_sums[i] * share;
  }
}

void TileRenderer::finish(std::size_t tile) const {
  const PixelRect inside = tiles_.at(tile).overlap(border_);
  if (inside.empty() || !is_wanted(tiles_.whole_at(tile))) return;
  for (int y = inside.y0; y < inside.y1; ++y) {
    const Pixel first{static_cast<std::uint16_t>(inside.x0), static_cast<std::uint16_t>(y)};
    for (int x = inside.x0; x < inside.x1; ++x) {
      const FilmColor pixel = film_->pixel(x, y);
      const std::size_t row = row_of(first) + static_cast<std::size_t>(x - inside.x0);
      targets_.combined[row] = pixel.color;
      if (!are_apart()) continue;
      targets_.denoising_albedo[row] = pixel.albedo;
      targets_.denoising_normal[row] = pixel.normal;
    }
  }
}

}  // namespace perfect_bvh
