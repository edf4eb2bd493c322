#include "traverse/dispatch.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include "core/aligned.h"
#include "core/errors.h"
#include "traverse/cpu_features.h"
#include "traverse/default_floating_point.h"
#include "traverse/ray_reordering.h"

namespace perfect_bvh {
namespace {

struct Available {
  std::array<const KernelTable*, 3> tables{};
  std::size_t count = 0;

  Available() noexcept {
    tables[count++] = &kScalarKernels;
#if PERFECT_BVH_HAVE_AVX2
    if (cpu_runs_avx2()) tables[count++] = &kAvx2Kernels;
#endif
#if PERFECT_BVH_HAVE_AVX512
    if (cpu_runs_avx512()) tables[count++] = &kAvx512Kernels;
#endif
#if PERFECT_BVH_HAVE_NEON
    tables[count++] = &kNeonKernels;  // every 64-bit ARM processor has it
#endif
  }
};

const Available& available() noexcept {
  static const Available found;
  return found;
}

const KernelTable& find_kernels(std::string_view name, const char* asker) {
  const auto all = available_kernels();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const KernelTable* table) { return table->name == name; });
  if (found != all.end()) return **found;
  std::string message = std::string(asker) + ": no kernels named \"" + std::string(name) + "\"; this machine runs";
  for (const KernelTable* table : all) message += std::string(" ") + table->name;
  throw InvalidArgument(message);
}

std::atomic<const KernelTable*> chosen{nullptr};

// The default number of rays in flight: their slots and stacks then fit into a first level cache of 32 KB. On an AMD
// EPYC (Zen 4), diffuse and occlusion rays are 3 to 13 % faster than with 64, for trees of 17 MB to 250 MB.
constexpr std::size_t kUsualRaysInFlight = 32;
static_assert(kUsualRaysInFlight <= kMostRaysInFlight);

// Very deep trees have long stacks. Then fewer rays share the memory.
constexpr std::size_t kWorkspaceLimit = std::size_t{4} << 20;

std::size_t fitting_rays(const KernelTable& kernels, const SceneView& scene, const RayBatch& batch,
                         std::size_t in_flight) {
  const std::size_t wanted = in_flight == 0 ? kUsualRaysInFlight : std::min(in_flight, kMostRaysInFlight);
  const std::size_t bytes = kernels.workspace_bytes(scene, 1);
  return std::min({wanted, std::max<std::size_t>(kWorkspaceLimit / bytes, 1), std::max<std::size_t>(batch.count, 1)});
}

// A kernel's memory, which its thread keeps from batch to batch. If a call traces while another batch of the thread is
// interrupted, the kept memory is in use, and the call allocates its own.
class Workspace {
 public:
  explicit Workspace(std::size_t bytes) : memory_(std::move(kept())) {
    if (memory_.size() >= bytes) return;
    memory_ = {};
    memory_.resize(bytes);
  }
  ~Workspace() { kept() = std::move(memory_); }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  [[nodiscard]] void* data() noexcept { return memory_.data(); }

 private:
  static AlignedVector<std::byte>& kept() noexcept {
    thread_local AlignedVector<std::byte> memory;
    return memory;
  }
  AlignedVector<std::byte> memory_;
};

// Returns a batch's rows from `first` on. The batch must have no order yet.
RayBatch part_of(const RayBatch& batch, std::size_t first, std::size_t count) {
  RayBatch part = batch;
  part.rays += first, part.count = count;
  if (part.counts != nullptr) part.counts += first;
  if (part.hits != nullptr) part.hits += first;
  if (part.occluded != nullptr) part.occluded += first;
  return part;
}

// The kernels of one kind of query.
struct Kernels {
  const KernelTable& table;
  void (*stream)(const SceneView&, const RayBatch&, void*, std::size_t);
  void (*packets)(const SceneView&, const RayBatch&, void*, bool*);

  void trace_stream(const SceneView& scene, const RayBatch& batch, std::size_t in_flight) const {
    const std::size_t rays = fitting_rays(table, scene, batch, in_flight);
    Workspace workspace(table.workspace_bytes(scene, rays));
    stream(scene, batch, workspace.data(), rays);
  }
  void trace_packets(const SceneView& scene, const RayBatch& batch, bool* left) const {
    Workspace workspace(table.packet_workspace_bytes(scene));
    packets(scene, batch, workspace.data(), left);
  }
  // Reorders the rays for good packets, traces the coherent packets, then the rays that are left.
  std::size_t trace_by_coherence(const SceneView& scene, const RayBatch& batch, std::size_t in_flight) const {
    thread_local std::unique_ptr<ReorderingSpace> kept;
    auto own = kept ? std::move(kept) : std::make_unique<ReorderingSpace>();  // as in Workspace
    ReorderingSpace& space = *own;
    const double reach = static_cast<double>(scene.extent.reach) / static_cast<double>(scene.scale);
    std::size_t in_packets = batch.count;
    for (std::size_t begin = 0; begin < batch.count; begin += kReorderedRays) {
      RayBatch slab = part_of(batch, begin, std::min(kReorderedRays, batch.count - begin));
      if (reorder_rays({slab.rays, slab.count}, reach, space)) slab.order = space.order;
      std::array<bool, kReorderedRays / kPacketRays> is_left{};
      trace_packets(scene, slab, is_left.data());
      const std::size_t left = gather_left(slab, is_left, space.order);
      in_packets -= left;
      if (left == 0) continue;
      if (left < slab.count) slab.order = space.order, slab.count = left;
      trace_stream(scene, slab, in_flight);
    }
    kept = std::move(own);
    return in_packets;
  }

  // Writes the rows of the skipped packets to `rows`, which may be the batch's own order; returns their number.
  template <std::size_t kPackets>
  static std::size_t gather_left(const RayBatch& batch, const std::array<bool, kPackets>& is_left,
                                 std::uint32_t* rows) {
    std::size_t count = 0;
    for (std::size_t begin = 0; begin < batch.count; begin += kPacketRays) {
      if (!is_left[begin / kPacketRays]) continue;
      const std::size_t end = std::min<std::size_t>(begin + kPacketRays, batch.count);
      for (std::size_t i = begin; i < end; ++i) rows[count++] = static_cast<std::uint32_t>(row_of(batch, i));
    }
    return count;
  }
};

std::size_t trace(const Kernels& kernels, const SceneView& scene, const RayBatch& batch, const TraceOptions& options) {
  if (batch.count == 0) return 0;
  const DefaultFloatingPoint environment;
  const bool may_pack = kernels.packets != nullptr && batch.counts == nullptr && !scene.is_empty;
  if (may_pack && options.strategy == Strategy::kPackets) {
    kernels.trace_packets(scene, batch, nullptr);
    return batch.count;
  }
  // Packet rays enter moving instances one by one.
  const bool pays = scene.motions == nullptr || scene.is_mostly_still;
  if (may_pack && pays && options.strategy == Strategy::kAuto) {
    return kernels.trace_by_coherence(scene, batch, options.in_flight);
  }
  kernels.trace_stream(scene, batch, options.strategy == Strategy::kSingle ? 1 : options.in_flight);
  return 0;
}

}  // namespace

std::span<const KernelTable* const> available_kernels() noexcept {
  return {available().tables.data(), available().count};
}

const KernelTable& active_kernels() {
  if (const KernelTable* table = chosen.load(std::memory_order_acquire)) return *table;
  const char* const wanted = std::getenv("PERFECT_BVH_ISA");
  const KernelTable& table =
      wanted != nullptr && *wanted != '\0' ? find_kernels(wanted, "PERFECT_BVH_ISA") : *available_kernels().back();
  chosen.store(&table, std::memory_order_release);
  return table;
}

void set_active_kernels(std::string_view name) {
  chosen.store(name.empty() ? nullptr : &find_kernels(name, "set_active_isa"), std::memory_order_release);
}

std::size_t trace_closest(const SceneView& scene, const RayBatch& batch, const TraceOptions& options) {
  const KernelTable& table = active_kernels();
  return trace({table, table.trace_closest, table.trace_packets_closest}, scene, batch, options);
}

std::size_t trace_any(const SceneView& scene, const RayBatch& batch, const TraceOptions& options) {
  const KernelTable& table = active_kernels();
  return trace({table, table.trace_any, table.trace_packets_any}, scene, batch, options);
}

std::size_t find_all_hits(const SceneView& scene, const RayBatch& batch, const FoundHits& found) {
  const KernelTable& kernels = active_kernels();
  Workspace workspace(kernels.workspace_bytes(scene, 1));
  const DefaultFloatingPoint environment;
  return kernels.find_all_hits(scene, batch, found, workspace.data());
}

void find_closest_points(const SceneView& scene, std::span<const PointQuery> queries, std::span<NearestPoint> nearest) {
  const KernelTable& kernels = active_kernels();
  Workspace workspace(kernels.point_workspace_bytes(scene));
  const DefaultFloatingPoint environment;
  kernels.find_closest_points(scene, queries.data(), queries.size(), nearest.data(), workspace.data());
}

}  // namespace perfect_bvh
