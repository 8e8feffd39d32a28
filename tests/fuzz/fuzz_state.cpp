#include <cstdlib>

#include "inputs.hpp"

// TIEFMU_FUZZ_SCENE: the scene.bin whose states these are.
extern "C" int LLVMFuzzerTestOneInput(const unsigned char* bytes, std::size_t size) {
  takeState(std::getenv("TIEFMU_FUZZ_SCENE"), bytes, size);
  return 0;
}
