// Tests of the FMU's functions that need a sanitizer, random calls by the hundred thousand, or failing memory.
//
//   tiefmu_calls states|failures|threads FMI FOLDER...
//   tiefmu_calls leaks FMI COUNT FOLDER...
//   tiefmu_calls sequences FMI COUNT FIRST FOLDER...  COUNT 1: repeats one sequence aloud
//   tiefmu_calls resources FILE...                    what the fuzzers start from, and what they found once
//   tiefmu_calls serialised SCENE FILE...
//
// FMI: 2 or 3. FOLDER: of a packed scene's scene.bin. Exit status 1 and one line on stderr: a defect.
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "../fuzz/inputs.hpp"
#include "tests.hpp"

namespace {

std::string contents(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  require(stream.good(), path + ": cannot be read");
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

}  // namespace

int main(int count, char** words) {
  std::vector<std::string> arguments(words + 1, words + count);
  const auto next = [&] {
    require(!arguments.empty(), "too few arguments");
    const std::string first = arguments.front();
    arguments.erase(arguments.begin());
    return first;
  };
  const auto number = [&] { return std::atol(next().c_str()); };
  const std::string test = next();
  if (test == "resources" || test == "serialised") {
    const std::string scene = test == "serialised" ? next() : "";
    for (const std::string& file : arguments) {
      const std::string bytes = contents(file);
      const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
      const bool taken = scene.empty() ? takeResource(data, bytes.size()) : takeState(scene, data, bytes.size());
      const bool found = file.find("found_") != std::string::npos;  // by a fuzzer: need not be taken, only survived
      require(taken || found, file + ": refused; run tests/fuzz/make_corpus.py again");
    }
    return 0;
  }
  const std::string version = next();
  require(version == "2" || version == "3", "no FMI '" + version + "'");
  const Standard& standard = version == "2" ? fmi2 : fmi3;
  const long amount = test == "sequences" || test == "leaks" ? number() : 0;
  const long first = test == "sequences" ? number() : 0;
  require(!arguments.empty(), "no folder");
  std::vector<Packed> packed;
  packed.reserve(arguments.size());
  for (const std::string& folder : arguments) packed.emplace_back(folder, standard);
  if (test == "sequences")
    testSequences(packed, amount, first);
  else if (test == "threads")
    testThreads(packed);
  else
    for (const Packed& p : packed)
      if (test == "states")
        testStates(p);
      else if (test == "failures")
        testFailures(p);
      else if (test == "leaks")
        testLeaks(p, amount);
      else
        fail("no test '" + test + "'");
}
