// The tests of this program, by the names on its command line. Each ends the program at the first defect.
#pragma once

#include <string>
#include <vector>

#include "session.hpp"

// Every function in every state: allowed or refused as the standard's table says; what is refused changes nothing.
void testStates(const Packed& packed);
// Sequences number `first` .. of random calls with random arguments. Prints how often each function was called.
void testSequences(const std::vector<Packed>& packed, long count, long first);
// Memory fails, or something is thrown, at every allocation of every call in turn.
void testFailures(const Packed& packed);
// `count` instances created, used and freed hold no block of memory in the end.
void testLeaks(const Packed& packed, long count);
// Two instances at the same time, each in a thread of its own.
void testThreads(const std::vector<Packed>& packed);
