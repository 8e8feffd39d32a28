// How the benchmark measures.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <utility>

namespace bench {

inline double now() {
  using namespace std::chrono;
  return duration<double>(steady_clock::now().time_since_epoch()).count();
}

// Best of many short runs of `body`, some of which have the machine for themselves, in seconds per call. At least
// `least`, and no more than a hundred or than fit in two seconds.
template <class Body> double best(Body&& body, int least = 7) {
  constexpr double enough = 0.002, time = 2;
  body();
  long calls = 1;
  double shortest = 1e30;
  const double begin = now();
  for (int run = 0; run < least || (run < 100 && now() - begin < time);) {
    const double start = now();
    for (long k = 0; k < calls; ++k) body();
    const double taken = now() - start;
    if (taken < enough) {
      calls *= 2;
      continue;
    }
    shortest = std::min(shortest, taken / static_cast<double>(calls));
    ++run;
  }
  return shortest;
}

// One row of the table. `bytes`: that must move for one `n`-th of the work, where the triad is the limit; or 0.
inline void row(const char* name, std::size_t n, int threads, double value, const char* unit, double bytes = 0,
                double triad = 0) {
  std::printf("%s,%zu,%d,%.5g,%s,%.0f,%.2f\n", name, n, threads, value, unit, bytes, triad);
  std::fflush(stdout);
}

// The same permutation on every machine.
template <class Values> void shuffle(Values& values) {
  unsigned long long seed = 1;
  for (std::size_t k = values.size(); k-- > 1;) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    std::swap(values[k], values[(seed >> 33) % (k + 1)]);
  }
}

void fmu(const char* folder, const char* nothing);  // fmu.cpp

}  // namespace bench
