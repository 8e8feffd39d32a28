// Arguments of the calls, sound or spoilt.
#include <memory>

#include "sequence.hpp"

References Sequence::some(const References& from) {
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

References Sequence::any() {
  References all(packed_.start.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<fmi2ValueReference>(i);
  return some(all);
}

fmi2ValueReference Sequence::unknown() {
  const auto count = static_cast<fmi2ValueReference>(packed_.start.size());
  return random_.of(References{count, count + 1, ~0u, ~0u - 1, 0x80000000u});
}

Values Sequence::near(const References& references) {
  Values values;
  const double size = random_.once(30) ? 1e150 : random_.once(10) ? 0 : 1;
  for (fmi2ValueReference r : references)
    values.push_back((r < packed_.start.size() ? packed_.start[r] : 0) + size * random_.between(-0.3, 0.3));
  return values;
}

double Sequence::notFinite() { return random_.of(Values{nan, -nan, infinity, -infinity}); }

Attempt Sequence::make(const Row& r) {
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

Attempt Sequence::setDebugLogging(bool spoil) {
  std::vector<std::string> names;
  for (std::size_t n = random_.below(3); n > 0; --n)
    names.push_back(
        random_.of(std::vector<std::string>{"logStatusError", "logStatusWarning", "logTie", "logStability", "logAll"}));
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

Attempt Sequence::setupExperiment(bool spoil) {
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

Attempt Sequence::getReal(bool spoil) {
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

Attempt Sequence::setReal(bool spoil) {
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

Attempt Sequence::doStep(bool spoil) {
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

Attempt Sequence::onStates(const std::string& name, bool spoil) {
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

Attempt Sequence::deSerialize(std::size_t slot, std::size_t list, bool spoil) {
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

std::vector<fmi2Byte> Sequence::foreign() {
  Session session(other_);
  bring(session, stepComplete);
  return session.bytes[0];
}

Attempt Sequence::directional(bool spoil) {
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
            const fmi2Status status =
                fmi2GetDirectionalDerivative(s.component, null == 0 ? nullptr : unknowns.data(), unknowns.size(),
                                             null == 1 ? nullptr : knowns.data(), knowns.size(),
                                             null == 2 ? nullptr : change.data(), null == 3 ? nullptr : changes.data());
            if (status == fmi2OK) s.give(changes.data(), changes.size() * sizeof(double));
            return status;
          },
          spoil};
}

Attempt Sequence::inputDerivatives(bool spoil) {
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
            return fmi2SetRealInputDerivatives(s.component, null == 0 ? nullptr : references.data(), references.size(),
                                               null == 1 ? nullptr : orders.data(),
                                               null == 2 ? nullptr : values.data());
          },
          spoil};
}

Attempt Sequence::outputDerivatives(bool spoil) {
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
            const fmi2Status status =
                fmi2GetRealOutputDerivatives(s.component, null == 0 ? nullptr : references.data(), references.size(),
                                             null == 1 ? nullptr : orders.data(), null == 2 ? nullptr : values.data());
            if (status == fmi2OK) s.give(values.data(), values.size() * sizeof(double));
            return status;
          },
          spoil};
}

Attempt Sequence::statusOf(const std::string& name, bool spoil) {
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

Attempt Sequence::otherTypes(const std::string& name, bool spoil) {
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
