// Tests of the FMU's functions that need a sanitizer, random calls by the hundred thousand, or failing memory.
//
//   tiefmu_calls states|failures|threads FOLDER...
//   tiefmu_calls leaks COUNT FOLDER...
//   tiefmu_calls sequences COUNT FIRST FOLDER...      FIRST COUNT 1 repeats one sequence
//
// FOLDER: of a packed scene's scene.bin. Exit status 1 and one line on stderr: a defect.
#include <cstdlib>

#include "tests.hpp"

int main(int count, char** words) {
  const std::vector<std::string> arguments(words + 1, words + count);
  require(!arguments.empty(), "no test named");
  const std::string test = arguments[0];
  const std::size_t numbers = test == "sequences" ? 2 : test == "leaks" ? 1 : 0;
  require(arguments.size() > 1 + numbers, "too few arguments");
  const auto number = [&](std::size_t i) { return std::atol(arguments[i].c_str()); };
  const std::vector<Packed> packed(arguments.begin() + 1 + static_cast<std::ptrdiff_t>(numbers), arguments.end());
  if (test == "sequences") {
    testSequences(packed, number(1), number(2));
  } else if (test == "threads") {
    testThreads(packed);
  } else {
    for (const Packed& p : packed)
      if (test == "states") testStates(p);
      else if (test == "failures") testFailures(p);
      else if (test == "leaks") testLeaks(p, number(1));
      else fail("no test '" + test + "'");
  }
}
