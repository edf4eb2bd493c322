// The scene: meshes and their instances, edited freely, and committed to an immutable snapshot.
// In: validated arrays. Out: reports and snapshots. A failed or cancelled commit leaves the edits pending and
// unchanged. Snapshots taken before stay valid.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "blas/make_blas.h"
#include "builders/builder.h"
#include "core/aligned.h"
#include "core/cancel.h"
#include "core/errors.h"
#include "core/thread_pool.h"
#include "mesh/round_mesh.h"
#include "scene/ray_shares.h"
#include "tlas/assemble.h"

namespace perfect_bvh {

struct InstanceInput {
  std::int32_t mesh_id;
  Affine object_to_world;
  std::uint32_t mask = 0xFFFFFFFFu;
  std::optional<std::int64_t> order;  // default: the instance's id
};

// Matrices of four columns, row by row. T: float or double.
template <class T>
struct Matrices {
  const T* entries;
  std::size_t count;
  std::size_t row_count;  // of each; rows after the third are ignored

  [[nodiscard]] Affine operator[](std::size_t i) const noexcept {
    const T* m = entries + i * row_count * 4;
    return {{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}, {m[3], m[7], m[11]}};
  }
};

// The lock of a scene's edits, held during a whole commit. A commit's callback would deadlock if it edited the same
// scene or read data that edits change: it gets an error instead.
class EditMutex {
 public:
  // Throws EngineError if this thread holds it.
  void lock() {
    if (owner_.load(std::memory_order_relaxed) == std::this_thread::get_id()) {
      throw EngineError("a commit of this scene is under way: its progress callable must not use the scene");
    }
    mutex_.lock();
    owner_.store(std::this_thread::get_id(), std::memory_order_relaxed);
  }
  void unlock() noexcept {
    owner_.store(std::thread::id(), std::memory_order_relaxed);
    mutex_.unlock();
  }

 private:
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_{};
};

class Scene {
 public:
  Scene() = default;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Every edit checks all of its input before it changes anything; ids are never reused.
  std::int32_t add_mesh(Mesh mesh, const BuildConfig& config, Usage usage);
  template <class T>
  void update_mesh(std::int32_t mesh_id, std::span<const Vec3<T>> positions,
                   ThreadPool& pool = ThreadPool::shared());  // same topology
  // Moves curves or points; the number of spheres stays the same. If no radii are given, the radii stay.
  template <class T>
  void update_balls(std::int32_t mesh_id, PrimitiveKind kind, const BallsGiven<T>& balls,
                    ThreadPool& pool = ThreadPool::shared());
  // Moves curves that are divided into chains, if each chain has as many spheres as before; otherwise replaces them.
  template <class T>
  void set_chains(std::int32_t mesh_id, const BallsGiven<T>& balls, std::span<const std::int64_t> offsets,
                  ThreadPool& pool = ThreadPool::shared());
  // Replaces a mesh by one of the same primitive kind. `function` opens messages.
  void replace_mesh(std::int32_t mesh_id, Mesh mesh, const char* function = "replace_mesh");
  // Moves triangles within the shutter. Positions are given at each step, one step after another; the topology stays.
  template <class T>
  void set_mesh_motion(std::int32_t mesh_id, std::span<const Vec3<T>> positions, const StepTimes& times,
                       ThreadPool& pool = ThreadPool::shared());
  // The same for curves or points. offsets: of the chains of each step's spheres; empty for points and for curves
  // without chains.
  template <class T>
  void set_round_motion(std::int32_t mesh_id, PrimitiveKind kind, const BallsGiven<T>& balls,
                        std::span<const std::int64_t> offsets, const StepTimes& times,
                        ThreadPool& pool = ThreadPool::shared());
  void set_usage(std::int32_t mesh_id, Usage usage);                  // for its next builds
  void remove_mesh(std::int32_t mesh_id);                             // throws InvalidArgument while instances use it
  std::int32_t add_instances(std::span<const InstanceInput> inputs);  // returns the first new id; the others follow
  // Adds one instance for each mesh id. orders: as many, or empty.
  template <class T>
  std::int32_t add_instances(std::span<const std::int32_t> mesh_ids, Matrices<T> matrices,
                             std::span<const std::uint32_t> masks, std::span<const std::int64_t> orders);
  void set_transforms(std::span<const std::int32_t> ids, std::span<const Affine> transforms);
  template <class T>
  void set_transforms(std::span<const std::int32_t> ids, Matrices<T> matrices, ThreadPool& pool);
  // Moves instances within the shutter: a matrix for each at the first step, then at the second, and so on. Throws
  // InvalidArgument for matrices that flatten space, because they do not define a rotation.
  template <class T>
  void set_instance_motion(std::span<const std::int32_t> ids, Matrices<T> matrices, const StepTimes& times);
  void set_masks(std::span<const std::int32_t> ids, std::span<const std::uint32_t> masks);
  void remove_instances(std::span<const std::int32_t> ids);

  // Builds everything that changed and makes a new snapshot. The callback of `cancel` must not use the scene
  // (EngineError).
  CommitReport commit(ThreadPool& pool, CancelToken& cancel, const CommitOptions& options = {});

  // Makes queries fail with this sentence until the next commit.
  void mark_stale(std::string why);
  [[nodiscard]] bool is_current() const;
  // Returns the committed state. Throws StaleScene if edits are pending or the scene was marked stale.
  [[nodiscard]] std::shared_ptr<const Snapshot> snapshot() const;

  // Unique in this process.
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  // Returns the rays cast at its snapshots, including those of images and their lights.
  [[nodiscard]] std::uint64_t rays_cast() const noexcept { return rays_cast_->load(std::memory_order_relaxed); }
  [[nodiscard]] std::size_t mesh_count() const;
  [[nodiscard]] std::size_t instance_count() const;

 private:
  struct MeshSlot : MeshState {
    std::uint32_t user_count = 0;           // instances
    std::uint64_t cast_before = 0;          // rays cast at the scene before the tree was built
    double ray_share = 0;                   // the share of the scene's rays that hit its box ...
    std::optional<std::uint64_t> share_of;  // ... after this number of edits; empty: unknown
  };

  [[nodiscard]] static std::uint64_t next_id() noexcept;
  // input(i) returns the i-th InstanceInput.
  template <class Input>
  std::int32_t append_instances(std::size_t count, const Input& input);
  // map(i) returns the transform of ids[i].
  template <class Map>
  void move_instances(std::span<const std::int32_t> ids, const Map& map, ThreadPool& pool);
  MeshSlot& find_mesh(std::int32_t mesh_id, const char* function);
  template <class T>
  void move(MeshSlot& slot, const BallsGiven<T>& balls, ThreadPool& pool, const char* function);
  void replace(MeshSlot& slot, Mesh mesh);
  // The row of each instance. If ids and rows are both consecutive, as they usually are, no rows are stored.
  struct InstanceRows {
    std::size_t count = 0, first = 0;
    std::vector<std::size_t> rows;  // empty: first, first + 1, ...
    bool is_ascending = true;       // so no row is repeated
    [[nodiscard]] std::size_t operator[](std::size_t i) const noexcept { return rows.empty() ? first + i : rows[i]; }
  };
  InstanceRows find_instances(std::span<const std::int32_t> ids, const char* function) const;
  void mark_edited();

  [[nodiscard]] RayForecast forecast_rays(const CommitOptions& options);
  [[nodiscard]] double most_served_rays(const MeshSlot& slot, const RayForecast& rays) const noexcept;
  [[nodiscard]] static bool may_be_replaced(MeshSlot& slot, double served, const CommitOptions& options,
                                            CancelToken& cancel);
  [[nodiscard]] std::vector<ChangedMesh> find_changed(const CommitOptions& options, const RayForecast& rays,
                                                      CancelToken& cancel);
  void find_ray_shares(std::span<const ChangedMesh> meshes, CancelToken& cancel);
  [[nodiscard]] static std::vector<BlasResult> make_blases(std::span<const ChangedMesh> changed,
                                                           const CommitOptions& options, ThreadPool& pool,
                                                           CancelToken& cancel);
  [[nodiscard]] PlacedMeshes meshes_to_place(std::span<const BlasResult> results) const;
  [[nodiscard]] std::shared_ptr<Snapshot> take_last_snapshot();
  [[nodiscard]] std::shared_ptr<const Snapshot> assemble_snapshot(std::span<const BlasResult> results,
                                                                  const RayForecast& rays, TopLevelReport& report,
                                                                  ThreadPool& pool, CancelToken& cancel);
  void publish(std::shared_ptr<const Snapshot> snapshot, std::span<BlasResult> results, const RayForecast& rays,
               std::uint64_t stale_count) noexcept;

  const std::uint64_t id_ = next_id();  // unique in this process
  mutable EditMutex edit_mutex_;        // held by every edit and during a whole commit
  std::map<std::int32_t, MeshSlot> meshes_;
  AlignedVector<Placement> instances_;  // by ascending id
  std::int32_t next_mesh_id_ = 0;
  std::int32_t next_instance_id_ = 0;
  std::optional<double> told_rays_;  // by the last commit that expected rays
  std::uint64_t cast_until_last_commit_ = 0;
  std::uint64_t cast_until_shares_ = 0;  // until shares were last computed
  const std::shared_ptr<std::atomic<std::uint64_t>> rays_cast_ = std::make_shared<std::atomic<std::uint64_t>>(0);

  mutable std::mutex state_mutex_;            // held briefly; taken after edit_mutex_ if both are
  std::uint64_t edit_count_ = 0;              // changes only while edit_mutex_ is also held
  std::shared_ptr<const Snapshot> snapshot_;  // null before the first commit, and after a commit that failed
  std::uint64_t generation_ = 0;              // of the last commit
  std::uint64_t committed_edit_count_ = 0;
  std::string stale_reason_;
  std::uint64_t stale_count_ = 0;
};

}  // namespace perfect_bvh
