// Numbers in messages.
#pragma once

#include <cstdio>
#include <string>

namespace tiefmu {

inline std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", value);
  return buffer;
}

}  // namespace tiefmu
