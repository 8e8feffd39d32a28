// Threads that share the loops of one simulation.
#pragma once

#include <atomic>
#include <cassert>
#include <cstdint>
#include <thread>
#include <vector>

namespace tiefmu {

// Lives with the simulation that made it: its threads end in the destructor. They wait by spinning for some
// microseconds, then asleep.
class ThreadPool {
 public:
  // The caller is one of `threads`. Throws std::system_error where the system has none left.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  // body(k) once for each k in [0, count), count < 65536, on whichever thread comes first; returns when all have
  // returned. `body` must not throw.
  template <class Body> void each(int count, const Body& body) {
    if (count < 2 || threads_.empty()) {
      for (int k = 0; k < count; ++k) body(k);
      return;
    }
    assert(count < 65536);
    run(count, [](const void* b, int k) { (*static_cast<const Body*>(b))(k); }, &body);
  }
  int threads() const { return static_cast<int>(threads_.size()) + 1; }

 private:
  using Call = void (*)(const void* body, int k);
  void run(int count, Call call, const void* body);
  bool takeOne();
  void work();
  void end();

  // What is to be done, as one number: round (32 bits), count (16), next to be taken (16).
  std::atomic<std::uint64_t> ticket_{0};
  std::atomic<int> done_{0};
  std::atomic<bool> stop_{false};
  Call call_ = nullptr;
  const void* body_ = nullptr;
  std::vector<std::thread> threads_;
};

}  // namespace tiefmu
