#include "thread_pool.hpp"

namespace tiefmu {
namespace {

constexpr int spins = 4000;

void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

}  // namespace

ThreadPool::ThreadPool(int threads) {
  assert(threads > 0);
  threads_.reserve(threads - 1);
  try {
    for (int k = 1; k < threads; ++k) threads_.emplace_back([this] { work(); });
  } catch (...) {
    end();
    throw;
  }
}

ThreadPool::~ThreadPool() { end(); }

void ThreadPool::end() {
  stop_.store(true);
  ticket_.fetch_add(std::uint64_t{1} << 32);
  ticket_.notify_all();
  for (std::thread& t : threads_) t.join();
  threads_.clear();
}

// Takes and does one piece, if any is left. Only who has taken a piece of a round may read what the round is about:
// it cannot end before that piece is done.
bool ThreadPool::takeOne() {
  std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
  do {
    if ((ticket & 0xffff) >= (ticket >> 16 & 0xffff)) return false;
  } while (!ticket_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel));
  call_(body_, static_cast<int>(ticket & 0xffff));
  done_.fetch_add(1, std::memory_order_release);
  return true;
}

void ThreadPool::work() {
  for (int idle = 0; !stop_.load(std::memory_order_relaxed);) {
    const std::uint64_t before = ticket_.load(std::memory_order_acquire);
    if (takeOne()) {
      idle = 0;
    } else if (++idle < spins) {
      pause();
    } else {
      ticket_.wait(before);
      idle = 0;
    }
  }
}

void ThreadPool::run(int count, Call call, const void* body) {
  call_ = call;
  body_ = body;
  done_.store(0, std::memory_order_relaxed);
  const std::uint64_t round = (ticket_.load(std::memory_order_relaxed) >> 32) + 1;
  ticket_.store(round << 32 | static_cast<std::uint64_t>(count) << 16, std::memory_order_release);
  ticket_.notify_all();
  while (takeOne()) {
  }
  for (int idle = 0; done_.load(std::memory_order_acquire) < count; ++idle) {
    if (idle < spins)
      pause();
    else
      std::this_thread::yield();
  }
}

}  // namespace tiefmu
