// A call that is refused: the instance is as before. Every other exception puts it into the state `error`.
#pragma once

#include <stdexcept>

namespace tiefmu {

struct Refused : std::runtime_error { using std::runtime_error::runtime_error; };

}  // namespace tiefmu
