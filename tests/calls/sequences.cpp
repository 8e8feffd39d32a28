// Random calls to two instances of a scene. The first gets every call, the second only those that must not be refused:
// what is refused has to leave no trace, so the two answer alike, bit for bit, to the end - but for the outputs in the
// state `error`, which are those last computed: a refused get computes too. What must be refused is told by the
// standard's table, a clock, and how the arguments were spoilt.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <memory>

#include "memory.hpp"
#include "tests.hpp"

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();

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

using Call = std::function<fmi2Status(Session&)>;

// A call, and whether it has to be refused; if not it may still end in an error: a step can diverge.
struct Attempt {
  Call call;
  bool refused = false;
};

struct Count { long good = 0, refused = 0, errors = 0; };

class Sequence {
 public:
  Sequence(const Packed& packed, const Packed& other, std::uint64_t seed, std::map<std::string, Count>& counts)
      : packed_(packed),
        other_(other),
        random_(seed),
        tested_(packed, random_.once(2)),
        twin_(packed),
        counts_(counts) {}

  void run() {
    const std::size_t length = 5 + random_.below(40);
    for (std::size_t i = 0; i < length; ++i) {
      step(next());
    }
    if (state_ != instantiated)
      require(row("fmi2GetReal").call(tested_) == row("fmi2GetReal").call(twin_) &&
                  (tested_.result == twin_.result || state_ == error),
              where_ + "refused calls have changed values");
    require(rerun(tested_) == rerun(twin_), where_ + "another run after a reset");
  }

 private:
  struct Kept {
    State state;
    double time, stop;
  };

  // Half the time what a caller does next, so that sequences get somewhere.
  const Row& next() {
    static const std::vector<std::string> running{"fmi2DoStep",
                                                  "fmi2DoStep",
                                                  "fmi2SetReal",
                                                  "fmi2GetReal",
                                                  "fmi2SetRealInputDerivatives",
                                                  "fmi2GetFMUstate",
                                                  "fmi2SetFMUstate",
                                                  "fmi2SerializeFMUstate",
                                                  "fmi2DeSerializeFMUstate"};
    if (random_.once(2)) return random_.of(standard);
    switch (state_) {
      case instantiated: return row(random_.once(4) ? "fmi2SetupExperiment" : "fmi2EnterInitializationMode");
      case initializationMode: return row("fmi2ExitInitializationMode");
      case stepComplete: return row(random_.of(running));
      default: return random_.once(4) ? row("fmi2SetFMUstate") : random_.of(standard);
    }
  }

  static std::string rerun(Session& session) {
    require(fmi2Reset(session.component) == fmi2OK, "no reset");
    return future(session, instantiated);
  }

  void step(const Row& r) {
    const State before = state_;
    Attempt attempt = make(r);
    const bool nowhere = random_.once(60);  // no instance at all
    const bool refused = nowhere || attempt.refused || !r.with(before);
    if (nowhere) {
      const fmi2Component component = tested_.component;
      tested_.component = nullptr;
      require(attempt.call(tested_) == fmi2Error, std::string(r.name) + ": no instance, but no error");
      tested_.component = component;
      return;
    }
    trace(r, attempt, before);
    tested_.log.clear();
    tested_.result.clear();
    const fmi2Status status = attempt.call(tested_);
    if (aloud)
      std::fprintf(stderr, "%s status %d%s, %s\n", where_.c_str(), status, refused ? " due" : "",
                   tested_.log.empty() ? "" : tested_.log.back().text.c_str());
    Count& count = counts_[r.name];
    ++(refused ? count.refused : status == fmi2Error ? count.errors : count.good);
    if (refused) require(status == fmi2Error, where_ + "not refused");
    require(status == fmi2OK || status == fmi2Error || (status == fmi2Discard && !refused), where_ + "another status");
    if (status == fmi2Error) {
      require(!tested_.log.empty(), where_ + "an error without a message");
      const Message& last = tested_.log.back();
      require(last.status == fmi2Error && last.category == "logStatusError" &&
                  last.text.compare(0, std::strlen(r.name), r.name) == 0 && last.text.find('\n') == std::string::npos,
              where_ + "says '" + last.text + "'");
    }
    if (refused) return;
    twin_.result.clear();
    require(attempt.call(twin_) == status, where_ + "two instances disagree");
    require(tested_.result == twin_.result || before == error, where_ + "two instances give different values");
    follow(r, status);
  }

  // The state after a call that was not to be refused.
  void follow(const Row& r, fmi2Status status) {
    const std::string name = r.name;
    if (status == fmi2Error) {
      // Refused after all, for a reason that only the FMU knows, or failed: a call that sets nothing tells.
      fmi2Boolean over = fmi2False;
      const bool alive = state_ == terminated ? fmi2GetBooleanStatus(tested_.component, fmi2Terminated, &over) == fmi2OK
                                              : fmi2SetReal(tested_.component, nullptr, 0, nullptr) == fmi2OK;
      if (!alive) state_ = error;
    } else if (name == "fmi2EnterInitializationMode") {
      state_ = initializationMode;
    } else if (name == "fmi2ExitInitializationMode") {
      state_ = stepComplete;
    } else if (name == "fmi2Terminate") {
      state_ = terminated;
    } else if (name == "fmi2Reset") {
      state_ = instantiated;
      time_ = 0;
      stop_ = infinity;
    } else if (after_) {
      after_();
    }
  }

  void trace(const Row& r, const Attempt& attempt, State before) {
    char line[300];
    std::snprintf(line, sizeof line, "%s%s, %s in state %s: ", prefix.c_str(), packed_.folder.c_str(), r.name,
                  stateName(before));
    where_ = line + std::string(attempt.refused ? "(spoilt) " : "");
  }

  // Arguments ---------------------------------------------------------------------------------------------------------

  References some(const References& from) {
    References references;
    if (from.empty()) return references;
    switch (random_.below(4)) {
      case 0: return from;
      case 1: return {random_.of(from)};
      case 2: {  // a run
        const std::size_t first = random_.below(from.size()), count = 1 + random_.below(from.size() - first);
        return {from.begin() + static_cast<std::ptrdiff_t>(first),
                from.begin() + static_cast<std::ptrdiff_t>(first + count)};
      }
      default:
        for (std::size_t n = random_.below(20); n > 0; --n) references.push_back(random_.of(from));
        return references;
    }
  }

  References any() {
    References all(packed_.start.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<fmi2ValueReference>(i);
    return some(all);
  }

  fmi2ValueReference unknown() {
    const auto count = static_cast<fmi2ValueReference>(packed_.start.size());
    return random_.of(References{count, count + 1, ~0u, ~0u - 1, 0x80000000u});
  }

  Values near(const References& references) {
    Values values;
    const double size = random_.once(30) ? 1e150 : random_.once(10) ? 0 : 1;
    for (fmi2ValueReference r : references)
      values.push_back((r < packed_.start.size() ? packed_.start[r] : 0) + size * random_.between(-0.3, 0.3));
    return values;
  }

  double notFinite() { return random_.of(Values{nan, -nan, infinity, -infinity}); }

  Attempt make(const Row& r) {
    after_ = nullptr;
    const std::string name = r.name;
    const bool spoil = random_.once(4);
    if (name == "fmi2SetDebugLogging") return setDebugLogging(spoil);
    if (name == "fmi2SetupExperiment") return setupExperiment(spoil);
    if (name == "fmi2GetReal") return getReal(spoil);
    if (name == "fmi2SetReal") return setReal(spoil);
    if (name == "fmi2DoStep") return doStep(spoil);
    if (name.find("FMUstate") != std::string::npos) return onStates(name, spoil);
    if (name == "fmi2GetDirectionalDerivative") return directional(spoil);
    if (name == "fmi2SetRealInputDerivatives") return inputDerivatives(spoil);
    if (name == "fmi2GetRealOutputDerivatives") return outputDerivatives(spoil);
    if (name.size() > 6 && name.compare(name.size() - 6, 6, "Status") == 0) return statusOf(name, spoil);
    if (name.find("Integer") != std::string::npos || name.find("Boolean") != std::string::npos ||
        name.find("String") != std::string::npos)
      return otherTypes(name, spoil);
    return {r.call, false};
  }

  Attempt setDebugLogging(bool spoil) {
    std::vector<std::string> names;
    for (std::size_t n = random_.below(3); n > 0; --n)
      names.push_back(random_.of(
          std::vector<std::string>{"logStatusError", "logStatusWarning", "logTie", "logStability", "logAll"}));
    const std::size_t kind = random_.below(3);
    if (spoil) names.push_back(kind == 0 ? "" : kind == 1 ? std::string(3000, '%') : "logEvents %s%n");
    const fmi2Boolean on = static_cast<fmi2Boolean>(random_.bits());
    const bool null = spoil && random_.once(2), nullName = spoil && random_.once(2);
    return {[=](Session& s) {
              std::vector<fmi2String> list;
              for (const std::string& n : names) list.push_back(n.c_str());
              if (nullName) list.back() = nullptr;
              return fmi2SetDebugLogging(s.component, on, list.size(), null ? nullptr : list.data());
            },
            spoil};
  }

  Attempt setupExperiment(bool spoil) {
    double start = random_.of(Values{0, 0, 1, -3, 1e6}), stop = start + random_.of(Values{0.1, 1, 1e3, 0});
    const bool defined = random_.once(2);
    if (spoil) {
      if (defined && random_.once(2))
        stop = random_.once(2) ? start - 1 : nan;
      else
        start = notFinite();
    }
    after_ = [=, this] {
      time_ = start;
      stop_ = defined ? stop : infinity;
    };
    const double tolerance = random_.once(2) ? nan : 1e-3;
    return {[=](Session& s) { return fmi2SetupExperiment(s.component, fmi2True, tolerance, start, defined, stop); },
            spoil};
  }

  Attempt getReal(bool spoil) {
    References references = any();
    bool nullReferences = false, nullValues = false;
    if (spoil) {
      references.push_back(unknown());
      nullReferences = random_.once(3);
      nullValues = !nullReferences && random_.once(2);
    }
    return {[=](Session& s) {
              Values values(references.size(), nan);
              const fmi2Status status = fmi2GetReal(s.component, nullReferences ? nullptr : references.data(),
                                                    references.size(), nullValues ? nullptr : values.data());
              if (status == fmi2OK) s.give(values.data(), values.size() * sizeof(double));
              return status;
            },
            spoil};
  }

  Attempt setReal(bool spoil) {
    const bool parameters = !packed_.parameters.empty() && random_.once(8);
    References references = some(parameters ? packed_.parameters : packed_.inputs);
    Values values = near(references), none;
    for (double& v : parameters ? values : none)
      v = random_.once(20) ? random_.of(Values{-1, 0, 1e-300, 1e300}) : random_.between(0.5, 2);
    bool refused = parameters && !references.empty() && state_ == stepComplete;
    bool nullReferences = false, nullValues = false;
    if (spoil) {
      refused = true;
      switch (random_.below(4)) {
        case 0:
          references.push_back(random_.once(2) ? unknown()
                                               : random_.of(random_.once(2) ? packed_.calculated : packed_.outputs));
          values.push_back(1);
          break;
        case 1:
          references.push_back(packed_.inputs[0]);
          values.push_back(notFinite());
          break;
        default:
          references.push_back(packed_.inputs[0]);
          values.push_back(1);
          (random_.once(2) ? nullReferences : nullValues) = true;
      }
      std::swap(references[random_.below(references.size())], references.back());
      if (!std::isfinite(values.back())) {  // keep the two lists together
        references = {packed_.inputs[0]};
        values = {values.back()};
      }
    }
    return {[=](Session& s) {
              return fmi2SetReal(s.component, nullReferences ? nullptr : references.data(), references.size(),
                                 nullValues ? nullptr : values.data());
            },
            refused};
  }

  Attempt doStep(bool spoil) {
    double point = time_, size = random_.of(Values{0.001, 0.01, 0.013, 0.1});
    bool refused = point + size > stop_;
    if (spoil) {
      refused = true;
      if (random_.once(2))
        size = random_.of(Values{0, -0.0, -0.01, nan, infinity, -infinity});
      else
        point = random_.of(Values{time_ + 1, time_ - 0.05, nan, infinity, -infinity});
    } else if (random_.once(50)) {
      size = random_.of(Values{1e300, 5e-324, 1e-300});  // absurd, but the standard forbids none of them
      refused = point + size > stop_;
    }
    after_ = [=, this] { time_ = point + size; };
    const fmi2Boolean noSetState = static_cast<fmi2Boolean>(random_.below(2));
    return {[=](Session& s) { return fmi2DoStep(s.component, point, size, noSetState); }, refused};
  }

  // Index of an entry; mostly of one that holds something, unless it is to be written.
  template <class T> std::size_t filled(const std::vector<T>& list, bool written) {
    std::size_t at = random_.below(list.size());
    for (std::size_t tries = written ? 0 : 4; tries > 0 && list[at] == T{}; --tries) at = random_.below(list.size());
    return at;
  }

  Attempt onStates(const std::string& name, bool spoil) {
    const std::size_t slot = filled(tested_.saved, name == "fmi2GetFMUstate" || name == "fmi2DeSerializeFMUstate");
    const std::size_t list = filled(tested_.bytes, name == "fmi2SerializeFMUstate");
    const auto wrong = random_.once(2) ? reinterpret_cast<fmi2FMUstate>(std::uintptr_t{8}) : fmi2FMUstate{};
    const bool empty = !tested_.saved[slot];
    if (name == "fmi2GetFMUstate") {
      if (spoil) {
        auto at = std::make_shared<fmi2FMUstate>(reinterpret_cast<fmi2FMUstate>(std::uintptr_t{8}));
        const bool null = random_.once(2);
        return {[=](Session& s) { return fmi2GetFMUstate(s.component, null ? nullptr : at.get()); }, true};
      }
      after_ = [=, this] { kept_[slot] = {state_, time_, stop_}; };
      return {[=](Session& s) { return fmi2GetFMUstate(s.component, &s.saved[slot]); }};
    }
    if (name == "fmi2SetFMUstate") {
      after_ = [=, this] {
        state_ = kept_[slot].state;
        time_ = kept_[slot].time;
        stop_ = kept_[slot].stop;
      };
      return {[=](Session& s) { return fmi2SetFMUstate(s.component, spoil ? wrong : s.saved[slot]); }, spoil || empty};
    }
    if (name == "fmi2FreeFMUstate") {
      if (!spoil) return {[=](Session& s) { return fmi2FreeFMUstate(s.component, &s.saved[slot]); }};
      return {[=](Session& s) {
                fmi2FMUstate handle = reinterpret_cast<fmi2FMUstate>(std::uintptr_t{8});
                return fmi2FreeFMUstate(s.component, &handle);
              },
              true};
    }
    if (name == "fmi2SerializedFMUstateSize")
      return {[=](Session& s) {
                std::size_t size = 0;
                const bool null = spoil && wrong;
                const fmi2FMUstate state = spoil && !null ? nullptr : s.saved[slot];
                const fmi2Status status = fmi2SerializedFMUstateSize(s.component, state, null ? nullptr : &size);
                s.give(&size, sizeof size);
                return status;
              },
              spoil || empty};
    if (name == "fmi2SerializeFMUstate") {
      after_ = [=, this] { keptBytes_[list] = kept_[slot]; };
      const std::size_t less = spoil ? 1 + random_.below(30) : 0;
      return {[=](Session& s) {
                std::size_t size = 0;
                if (fmi2SerializedFMUstateSize(s.component, s.saved[slot], &size) != fmi2OK) size = 64;
                std::vector<fmi2Byte> bytes(size - less);
                const fmi2Status status = fmi2SerializeFMUstate(s.component, s.saved[slot],
                                                                spoil && wrong ? nullptr : bytes.data(), bytes.size());
                // Not the bytes: outputs that nobody has asked for yet may stand there or not.
                s.give(&size, sizeof size);
                if (status == fmi2OK) s.bytes[list] = bytes;
                return status;
              },
              spoil || empty};
    }
    return deSerialize(slot, list, spoil);
  }

  Attempt deSerialize(std::size_t slot, std::size_t list, bool spoil) {
    std::vector<fmi2Byte> bytes = tested_.bytes[list];
    bool null = false, refused = bytes.empty();
    if (spoil) {
      refused = true;
      switch (random_.below(5)) {
        case 0: null = true; break;
        case 1: bytes = foreign(); break;
        case 2: bytes.resize(random_.below(bytes.size() + 1)); break;
        case 3:
          for (std::size_t n = random_.below(200); n > 0; --n) bytes.push_back(static_cast<fmi2Byte>(random_.bits()));
          break;
        default:
          if (bytes.empty()) bytes.resize(1 + random_.below(100));
          bytes[random_.below(bytes.size())] ^= static_cast<fmi2Byte>(1 << random_.below(7));
      }
      if (bytes == tested_.bytes[list]) bytes.push_back(0);
    }
    after_ = [=, this] { kept_[slot] = keptBytes_[list]; };
    return {[=](Session& s) {
              return fmi2DeSerializeFMUstate(s.component, null ? nullptr : bytes.data(), bytes.size(), &s.saved[slot]);
            },
            refused};
  }

  // A state of another scene.
  std::vector<fmi2Byte> foreign() {
    Session session(other_);
    bring(session, stepComplete);
    return session.bytes[0];
  }

  Attempt directional(bool spoil) {
    References unknowns = some(packed_.outputs), knowns = some(packed_.inputs);
    int null = -1;
    if (spoil) {
      unknowns.push_back(packed_.outputs[0]);
      knowns.push_back(packed_.inputs[0]);
      switch (random_.below(3)) {
        case 0: unknowns.push_back(unknown()); break;
        case 1: knowns.push_back(unknown()); break;
        default: null = static_cast<int>(random_.below(4));
      }
    }
    const Values change = near(knowns);
    return {[=](Session& s) {
              Values changes(unknowns.size(), nan);
              const fmi2Status status = fmi2GetDirectionalDerivative(
                  s.component, null == 0 ? nullptr : unknowns.data(), unknowns.size(),
                  null == 1 ? nullptr : knowns.data(), knowns.size(), null == 2 ? nullptr : change.data(),
                  null == 3 ? nullptr : changes.data());
              if (status == fmi2OK) s.give(changes.data(), changes.size() * sizeof(double));
              return status;
            },
            spoil};
  }

  Attempt inputDerivatives(bool spoil) {
    References references = some(packed_.inputs);
    if (spoil) references.push_back(packed_.inputs[0]);
    std::vector<fmi2Integer> orders;
    Values values;
    for (std::size_t i = 0; i < references.size(); ++i) {
      orders.push_back(random_.once(3) ? 2 : 1);
      values.push_back(random_.between(-0.3, 0.3));
    }
    int null = -1;
    if (spoil) {
      const std::size_t at = random_.below(references.size());
      switch (random_.below(5)) {
        case 0: references[at] = unknown(); break;
        case 1: references[at] = random_.of(packed_.outputs); break;
        case 2: orders[at] = random_.of(std::vector<fmi2Integer>{0, -1, 3, 2147483647, -2147483647 - 1}); break;
        case 3: values[at] = notFinite(); break;
        default: null = static_cast<int>(random_.below(3));
      }
    }
    return {[=](Session& s) {
              return fmi2SetRealInputDerivatives(s.component, null == 0 ? nullptr : references.data(),
                                                 references.size(), null == 1 ? nullptr : orders.data(),
                                                 null == 2 ? nullptr : values.data());
            },
            spoil};
  }

  Attempt outputDerivatives(bool spoil) {
    References references = some(packed_.outputs);
    if (spoil) references.push_back(packed_.outputs[0]);
    std::vector<fmi2Integer> orders(references.size(), 1);
    int null = -1;
    if (spoil) {
      const std::size_t at = random_.below(references.size());
      switch (random_.below(3)) {
        case 0: references[at] = unknown(); break;
        case 1: orders[at] = random_.of(std::vector<fmi2Integer>{0, -1, 2, 2147483647}); break;
        default: null = static_cast<int>(random_.below(3));
      }
    }
    return {[=](Session& s) {
              Values values(references.size(), nan);
              const fmi2Status status = fmi2GetRealOutputDerivatives(
                  s.component, null == 0 ? nullptr : references.data(), references.size(),
                  null == 1 ? nullptr : orders.data(), null == 2 ? nullptr : values.data());
              if (status == fmi2OK) s.give(values.data(), values.size() * sizeof(double));
              return status;
            },
            spoil};
  }

  Attempt statusOf(const std::string& name, bool spoil) {
    const auto kind = static_cast<fmi2StatusKind>(random_.below(4));
    const bool null = spoil;
    if (name == "fmi2GetRealStatus")
      return {[=](Session& s) {
                fmi2Real value = -1;
                const fmi2Status status = fmi2GetRealStatus(s.component, kind, null ? nullptr : &value);
                s.give(&value, sizeof value);
                return status;
              },
              null};
    if (name == "fmi2GetBooleanStatus")
      return {[=](Session& s) {
                fmi2Boolean value = -1;
                const fmi2Status status = fmi2GetBooleanStatus(s.component, kind, null ? nullptr : &value);
                s.give(&value, sizeof value);
                return status;
              },
              null};
    // The others have no value to give, whatever is asked: they write nowhere.
    if (name == "fmi2GetIntegerStatus")
      return {[=](Session& s) { return fmi2GetIntegerStatus(s.component, kind, nullptr); }};
    if (name == "fmi2GetStringStatus")
      return {[=](Session& s) { return fmi2GetStringStatus(s.component, kind, nullptr); }};
    return {[=](Session& s) { return fmi2GetStatus(s.component, kind, nullptr); }};
  }

  Attempt otherTypes(const std::string& name, bool spoil) {
    const std::size_t count = spoil ? 1 + random_.below(3) : 0;
    const bool null = random_.once(2);
    return {[=](Session& s) {
              const References list(count, 0);
              std::vector<fmi2Integer> numbers(count);
              std::vector<fmi2String> texts(count);
              const fmi2ValueReference* references = null ? nullptr : list.data();
              fmi2Integer* values = null ? nullptr : numbers.data();
              if (name == "fmi2GetInteger") return fmi2GetInteger(s.component, references, count, values);
              if (name == "fmi2SetInteger") return fmi2SetInteger(s.component, references, count, values);
              if (name == "fmi2GetBoolean") return fmi2GetBoolean(s.component, references, count, values);
              if (name == "fmi2SetBoolean") return fmi2SetBoolean(s.component, references, count, values);
              if (name == "fmi2GetString") return fmi2GetString(s.component, references, count, texts.data());
              return fmi2SetString(s.component, references, count, texts.data());
            },
            spoil};
  }

 public:
  std::string prefix;  // of messages: which sequence
  bool aloud = false;  // prints every call

 private:
  const Packed &packed_, &other_;
  Random random_;
  Session tested_, twin_;
  std::map<std::string, Count>& counts_;
  State state_ = instantiated;
  double time_ = 0, stop_ = infinity;
  Kept kept_[3]{}, keptBytes_[2]{};
  std::function<void()> after_;  // what a success changes
  std::string where_;
};

}  // namespace

void testSequences(const std::vector<Packed>& packed, long count, long first) {
  std::map<std::string, Count> counts;
  for (const Row& r : standard) counts[r.name];
  const auto run = [&](long number) {
    const std::size_t scenes = packed.size(), scene = static_cast<std::size_t>(number) % scenes;
    Sequence sequence(packed[scene], packed[(scene + 1) % scenes], static_cast<std::uint64_t>(number), counts);
    sequence.prefix = "sequence " + std::to_string(number) + ": ";
    sequence.aloud = count == 1;
    sequence.run();
  };
  run(first);  // what the libraries keep for good
  for (long i = first; i < first + count; ++i) {
    const long before = memory::blocks();
    run(i);
    const long lost = memory::blocks() - before;
    require(lost == 0, "sequence " + std::to_string(i) + ": memory lost");
  }
  std::printf("function,good,refused,errors\n");
  for (const auto& [name, c] : counts) std::printf("%s,%ld,%ld,%ld\n", name.c_str(), c.good, c.refused, c.errors);
}
