// One sequence of random calls to two instances of a scene. The first gets every call, the second only those that must
// not be refused: what is refused has to leave no trace, so the two answer alike, bit for bit, to the end - but for the
// outputs in the state `error`, which are those last computed: a refused get computes too. What must be refused is told
// by the standard's table, a clock, and how the arguments were spoilt.
#pragma once

#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "tests.hpp"

// SplitMix64: the same numbers everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
  }
  std::size_t below(std::size_t n) { return bits() % n; }
  bool once(std::size_t in) { return below(in) == 0; }
  double between(double low, double high) {
    return low + (high - low) * std::ldexp(static_cast<double>(bits() >> 11), -53);
  }
  template <class T> const T& of(const std::vector<T>& list) { return list[below(list.size())]; }

 private:
  std::uint64_t state;
};

using Call = std::function<int(Session&)>;

// A call, and whether it has to be refused; if not it may still end in an error: a step can diverge.
struct Attempt {
  Call call;
  bool refused = false;
};

struct Count { long good = 0, refused = 0, errors = 0; };

class Sequence {
 public:
  // Of the packed scenes' standard.
  static std::unique_ptr<Sequence> of(const Packed& packed, const Packed& other, std::uint64_t seed,
                                      std::map<std::string, Count>& counts);
  virtual ~Sequence() = default;
  void run();

  std::string prefix;  // of messages: which sequence
  bool aloud = false;  // prints every call

 protected:
  Sequence(const Packed& packed, const Packed& other, std::uint64_t seed, std::map<std::string, Count>& counts,
           bool asks)
      : packed_(packed),
        other_(other),
        random_(seed),
        tested_(packed, random_.once(2), asks),
        twin_(packed, false, asks),
        counts_(counts) {
    tested_.intrudes = asks;
  }

  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

  // What a caller does next on its way to the first step.
  virtual const char* onTheWay(State state) = 0;
  virtual Attempt make(const Row& r, bool spoil) = 0;

  // Arguments
  References some(const References& from);
  std::uint32_t unknown();
  Values near(const References& references);
  double notFinite();
  // The start of a run and its end.
  struct Times {
    double start, stop;
    bool defined;
  };
  Times times(bool spoil);  // of the coming run, when the call succeeds
  // A point in time and the size of a step, and whether they have to be refused.
  struct Step {
    double point, size;
    bool refused;
  };
  Step nextStep(bool spoil);
  // Values to set inputs to, or parameters, and whether that has to be refused.
  struct Setting {
    const References* from;
    References references;
    Values values;
    bool refused;
  };
  Setting setting();
  Attempt setDebugLogging(bool spoil, int (*call)(Session&, std::uint64_t on, std::size_t, const char* const[]));
  // Index of an entry; mostly of one that holds something, unless it is to be written.
  template <class T> std::size_t filled(const std::vector<T>& list, bool written) {
    std::size_t at = random_.below(list.size());
    for (std::size_t tries = written ? 0 : 4; tries > 0 && list[at] == T{}; --tries) at = random_.below(list.size());
    return at;
  }
  Attempt onStates(const std::string& name, bool spoil);

  const Packed &packed_, &other_;
  Random random_;
  Session tested_, twin_;
  State state_ = instantiated;
  double time_ = 0, stop_ = infinity;
  std::function<void()> after_;  // what a success changes

 private:
  struct Kept {
    State state;
    double time, stop;
  };
  // Half the time what a caller does next, so that sequences get somewhere.
  const Row& next();
  static std::string rerun(Session& session);
  void step(const Row& r);
  // The state after a call that was not to be refused.
  void follow(const Row& r, int status);
  void trace(const Row& r, const Attempt& attempt, State before);
  Attempt onBytes(std::size_t slot, std::size_t list, bool spoil);
  // A state of another scene.
  std::vector<char> foreign();

  std::map<std::string, Count>& counts_;
  Kept kept_[3]{}, keptBytes_[2]{};
  std::string where_;
};

std::unique_ptr<Sequence> sequenceOfFmi2(const Packed& packed, const Packed& other, std::uint64_t seed,
                                         std::map<std::string, Count>& counts);
std::unique_ptr<Sequence> sequenceOfFmi3(const Packed& packed, const Packed& other, std::uint64_t seed,
                                         std::map<std::string, Count>& counts);
