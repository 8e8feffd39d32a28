#include "inputs.hpp"

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* bytes, std::size_t size) {
  takeResource(bytes, size);
  return 0;
}
