#include "blas/moved_mesh.h"

#include <algorithm>
#include <atomic>

namespace perfect_bvh {
namespace {

// Vertices that a task copies: what it has just checked is still in a second level cache then.
constexpr std::size_t kGrain = 32768;

void copy(std::span<const Vec3f> positions, Mesh& mesh, ThreadPool& pool, const char* function) {
  std::atomic<bool> all_good{true};
  parallel_for(pool, positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    const auto chunk = positions.subspan(begin, end - begin);
    if (!are_good(chunk)) all_good = false;
    std::copy(chunk.begin(), chunk.end(), &mesh.positions[begin]);
  });
  if (!all_good) check_positions(positions, function);
}

// Around mesh.centre.
void copy(std::span<const Vec3d> positions, Mesh& mesh, ThreadPool& pool, const char* function) {
  check_positions(positions, function);
  parallel_for(pool, positions.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    narrow(positions.subspan(begin, end - begin), mesh.centre, &mesh.positions[begin]);
  });
}

}  // namespace

std::shared_ptr<const Mesh> lend_mesh(Mesh mesh, const std::shared_ptr<SparePositions>& spare) {
  auto owned = std::make_unique<Mesh>(std::move(mesh));
  const auto give_back = [spare](Mesh* done) noexcept {
    spare->give({std::move(done->positions), std::move(done->balls)});
    delete done;
  };
  return std::shared_ptr<Mesh>(owned.release(), give_back);  // if it throws, it gives back first
}

template <class T>
std::shared_ptr<const Mesh> move_vertices(const Mesh& mesh, std::span<const Vec3<T>> positions,
                                          const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                          const char* function) {
  check_count(positions.size(), mesh.positions.size(), function);
  Mesh moved;
  moved.triangles = mesh.triangles;
  moved.positions = spare->take().positions;
  moved.positions.resize(positions.size());
  if constexpr (sizeof(T) == sizeof(double)) moved.centre = box_centre(positions);
  copy(positions, moved, pool, function);
  return lend_mesh(std::move(moved), spare);
}

template <class T>
std::shared_ptr<const Mesh> move_in_steps(const Mesh& mesh, std::span<const Vec3<T>> positions, const StepTimes& times,
                                          const std::shared_ptr<SparePositions>& spare, ThreadPool& pool,
                                          const char* function) {
  const std::size_t count = mesh.positions.size();
  check_count(positions.size() / (times.last + std::size_t{1}), count, function);
  Mesh moved;
  moved.triangles = mesh.triangles;
  moved.times = times;
  if constexpr (sizeof(T) == sizeof(double)) moved.centre = box_centre(positions);
  for (std::uint32_t step = 1; step <= times.last; ++step) {
    auto later = std::make_shared<Mesh>();
    later->triangles = mesh.triangles, later->centre = moved.centre;
    later->positions.resize(count);
    copy(positions.subspan(step * count, count), *later, pool, function);
    moved.later.push_back(std::move(later));
  }
  moved.positions = spare->take().positions;
  moved.positions.resize(count);
  copy(positions.first(count), moved, pool, function);
  return lend_mesh(std::move(moved), spare);
}
template std::shared_ptr<const Mesh> move_in_steps(const Mesh&, std::span<const Vec3f>, const StepTimes&,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> move_in_steps(const Mesh&, std::span<const Vec3d>, const StepTimes&,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);

template std::shared_ptr<const Mesh> move_vertices(const Mesh&, std::span<const Vec3f>,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);
template std::shared_ptr<const Mesh> move_vertices(const Mesh&, std::span<const Vec3d>,
                                                   const std::shared_ptr<SparePositions>&, ThreadPool&, const char*);

}  // namespace perfect_bvh
