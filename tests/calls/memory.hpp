// Counts every block of memory that the program holds, and lets a chosen allocation fail.
#pragma once

namespace memory {

// What a failing allocation throws. One that cannot throw (malloc, new(nothrow)) gives a null pointer.
enum class Throws { badAlloc, exception, number };

// Of this thread: `successes` further allocations succeed, then one fails, or (`all`) every one.
void failAfter(long successes, Throws what, bool all = false);
// Back to normal; whether an allocation has failed.
bool succeedAgain();

// No failures while it lives: for what a test does inside the tested call, such as logging.
struct Pause {
  Pause();
  ~Pause();
};

long blocks();  // now held, by all threads

}  // namespace memory
