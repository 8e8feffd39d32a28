// Replaces operator new, and (by the linker's --wrap) malloc where our own objects call it, as Eigen does.
#include "memory.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <exception>
#include <new>

extern "C" {
void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* block, std::size_t size);
void __real_free(void* block);
}

namespace {

struct Injected : std::exception {
  const char* what() const noexcept override { return "injected exception"; }
};

thread_local bool armed = false, failed = false, always = false;
thread_local long left = 0;
thread_local int pauses = 0;
thread_local memory::Throws thrown{};
std::atomic<long> held{0};

bool fails() {
  if (!armed || pauses > 0 || left-- > 0) return false;
  failed = true;
  left = 0;
  armed = always;
  return true;
}

void* counted(void* block) {
  if (block) held.fetch_add(1, std::memory_order_relaxed);
  return block;
}

void* allocate(std::size_t size, std::size_t alignment) {
  if (alignment <= alignof(std::max_align_t)) return counted(__real_malloc(size ? size : 1));
  return counted(std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment));
}

void* allocateOrThrow(std::size_t size, std::size_t alignment = 0) {
  if (fails()) {
    if (thrown == memory::Throws::exception) throw Injected();
    if (thrown == memory::Throws::number) throw 7;
    throw std::bad_alloc();
  }
  void* block = allocate(size, alignment);
  return block ? block : throw std::bad_alloc();
}

void release(void* block) {
  if (block) held.fetch_sub(1, std::memory_order_relaxed);
  __real_free(block);
}

}  // namespace

namespace memory {

void failAfter(long successes, Throws what, bool all) {
  left = successes;
  thrown = what;
  always = all;
  failed = false;
  armed = true;
}

bool succeedAgain() {
  armed = false;
  return failed;
}

Pause::Pause() { ++pauses; }
Pause::~Pause() { --pauses; }

long blocks() { return held.load(); }

}  // namespace memory

extern "C" {
void* __wrap_malloc(std::size_t size) { return fails() ? nullptr : counted(__real_malloc(size)); }
void* __wrap_calloc(std::size_t count, std::size_t size) {
  return fails() ? nullptr : counted(__real_calloc(count, size));
}
void* __wrap_realloc(void* block, std::size_t size) {
  if (fails()) return nullptr;
  void* moved = __real_realloc(block, size);
  return block ? moved : counted(moved);
}
void __wrap_free(void* block) { release(block); }
}

void* operator new(std::size_t size) { return allocateOrThrow(size); }
void* operator new[](std::size_t size) { return allocateOrThrow(size); }
void* operator new(std::size_t size, std::align_val_t a) { return allocateOrThrow(size, static_cast<std::size_t>(a)); }
void* operator new[](std::size_t size, std::align_val_t a) {
  return allocateOrThrow(size, static_cast<std::size_t>(a));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return fails() ? nullptr : allocate(size, 0); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return fails() ? nullptr : allocate(size, 0); }
void operator delete(void* block) noexcept { release(block); }
void operator delete[](void* block) noexcept { release(block); }
void operator delete(void* block, std::size_t) noexcept { release(block); }
void operator delete[](void* block, std::size_t) noexcept { release(block); }
void operator delete(void* block, std::align_val_t) noexcept { release(block); }
void operator delete[](void* block, std::align_val_t) noexcept { release(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { release(block); }
void operator delete[](void* block, std::size_t, std::align_val_t) noexcept { release(block); }
