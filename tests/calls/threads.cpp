#include <thread>

#include "tests.hpp"

namespace {

std::string life(const Packed& packed) {
  std::string bytes;
  for (int i = 0; i < 3; ++i) {
    Session session(packed, true, true);
    bytes += future(session, instantiated);
    for (const Row& r : packed.standard.rows) {
      r.call(session);
      bytes += session.result;
    }
  }
  return bytes;
}

}  // namespace

void testThreads(const std::vector<Packed>& packed) {
  for (const Packed& first : packed)
    for (const Packed& second : packed) {
      std::string results[2];
      std::thread other([&] { results[1] = life(second); });
      results[0] = life(first);
      other.join();
      require(results[0] == life(first) && results[1] == life(second),
              first.folder + " and " + second.folder + ": other results than alone");
    }
}
