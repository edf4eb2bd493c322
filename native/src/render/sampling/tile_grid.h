// The tiles of an image. Their borders are at the same pixels for any rendered part of the image, so that the sums of a
// pixel's samples, tile by tile, are the same bit for bit.
#pragma once

#include <algorithm>

#include "render/sampling/camera.h"

namespace perfect_bvh {

inline constexpr int kTileSize = 32;

// Returns the tiles along one side of an image with this many pixels.
[[nodiscard]] constexpr std::size_t tile_count(int pixels) noexcept {
  return static_cast<std::size_t>((pixels + kTileSize - 1) / kTileSize);
}

class TileGrid {
 public:
  // area: the pixels to render; not empty.
  explicit TileGrid(PixelRect area) noexcept : area_(area) {}

  [[nodiscard]] PixelRect area() const noexcept { return area_; }
  [[nodiscard]] std::size_t count() const noexcept {
    return static_cast<std::size_t>(columns()) * static_cast<std::size_t>(last_row() - first_row() + 1);
  }
  // Returns the part of a tile inside the area.
  [[nodiscard]] PixelRect at(std::size_t tile) const noexcept {
    const PixelRect whole = whole_at(tile);
    return {std::max(whole.x0, area_.x0), std::max(whole.y0, area_.y0), std::min(whole.x1, area_.x1),
            std::min(whole.y1, area_.y1)};
  }
  [[nodiscard]] PixelRect whole_at(std::size_t tile) const noexcept {
    const int x = (first_column() + static_cast<int>(tile) % columns()) * kTileSize;
    const int y = (first_row() + static_cast<int>(tile) / columns()) * kTileSize;
    return {x, y, x + kTileSize, y + kTileSize};
  }

  // Visits the tiles with pixels of a rectangle, row by row.
  template <class Visit>
  void visit(PixelRect rect, const Visit& visit_tile) const {
    const int left = std::max(rect.x0 / kTileSize, first_column());
    const int right = std::min((rect.x1 - 1) / kTileSize, first_column() + columns() - 1);
    const int top = std::max(rect.y0 / kTileSize, first_row()),
              bottom = std::min((rect.y1 - 1) / kTileSize, last_row());
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        visit_tile(static_cast<std::size_t>((row - first_row()) * columns() + column - first_column()));
      }
    }
  }

 private:
  [[nodiscard]] int first_column() const noexcept { return area_.x0 / kTileSize; }
  [[nodiscard]] int first_row() const noexcept { return area_.y0 / kTileSize; }
  [[nodiscard]] int last_row() const noexcept { return (area_.y1 - 1) / kTileSize; }
  [[nodiscard]] int columns() const noexcept { return (area_.x1 - 1) / kTileSize - first_column() + 1; }

  PixelRect area_;
};

}  // namespace perfect_bvh
