// The lock of a scene's edits, held for the whole of a commit. A commit's callback that edits the same scene, or asks
// for what edits change, would wait for itself for ever: it is refused instead.
#pragma once

#include <atomic>
#include <mutex>
#include <thread>

#include "core/errors.h"

namespace perfect_bvh {

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

}  // namespace perfect_bvh
