#include "traverse/dispatch.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <string>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "core/aligned.h"
#include "core/errors.h"

namespace perfect_bvh {
namespace {

struct Available {
  std::array<const KernelTable*, 3> tables{};
  std::size_t count = 0;

  Available() noexcept {
    tables[count++] = &kScalarKernels;
#if defined(__x86_64__)
    __builtin_cpu_init();
#if PERFECT_BVH_HAVE_AVX2
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
        __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt")) {
      tables[count++] = &kAvx2Kernels;
#if PERFECT_BVH_HAVE_AVX512
      if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
        tables[count++] = &kAvx512Kernels;
      }
#endif
    }
#endif
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

// Denormals on, round to nearest, no traps: for as long as it lives.
class DefaultFloatingPoint {
 public:
#if defined(__x86_64__)
  DefaultFloatingPoint() noexcept : saved_(_mm_getcsr()) { _mm_setcsr(0x1F80); }
  ~DefaultFloatingPoint() { _mm_setcsr(saved_); }
#else
  DefaultFloatingPoint() noexcept = default;
  ~DefaultFloatingPoint() = default;
#endif
  DefaultFloatingPoint(const DefaultFloatingPoint&) = delete;
  DefaultFloatingPoint& operator=(const DefaultFloatingPoint&) = delete;

 private:
  [[maybe_unused]] unsigned saved_ = 0;
};

// Stacks of very deep trees are long: then fewer rays share the memory.
constexpr std::size_t kWorkspaceLimit = std::size_t{4} << 20;

std::size_t fitting_rays(const KernelTable& kernels, const SceneView& scene, const RayBatch& batch,
                         std::size_t in_flight) {
  const std::size_t wanted = in_flight == 0 ? kMostRaysInFlight : std::min(in_flight, kMostRaysInFlight);
  const std::size_t bytes = kernels.workspace_bytes(scene, 1);
  return std::min({wanted, std::max<std::size_t>(kWorkspaceLimit / bytes, 1), std::max<std::size_t>(batch.count, 1)});
}

template <class Trace>
void trace(const SceneView& scene, const RayBatch& batch, std::size_t in_flight, Trace KernelTable::* kernel) {
  const KernelTable& kernels = active_kernels();
  const std::size_t rays = fitting_rays(kernels, scene, batch, in_flight);
  thread_local AlignedVector<std::byte> workspace;
  const std::size_t bytes = kernels.workspace_bytes(scene, rays);
  if (workspace.size() < bytes) {
    workspace = {};
    workspace.resize(bytes);
  }
  const DefaultFloatingPoint environment;
  (kernels.*kernel)(scene, batch, workspace.data(), rays);
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

void trace_closest(const SceneView& scene, const RayBatch& batch, std::size_t in_flight) {
  trace(scene, batch, in_flight, &KernelTable::trace_closest);
}

void trace_any(const SceneView& scene, const RayBatch& batch, std::size_t in_flight) {
  trace(scene, batch, in_flight, &KernelTable::trace_any);
}

}  // namespace perfect_bvh
