// Arguments of the calls of FMI 2.0, sound or spoilt.
#include "sequence.hpp"

extern "C" {
#include "fmi2Functions.h"
}

namespace {

class SequenceOfFmi2 final : public Sequence {
 public:
  SequenceOfFmi2(const Packed& packed, const Packed& other, std::uint64_t seed, std::map<std::string, Count>& counts)
      : Sequence(packed, other, seed, counts, false) {}

 private:
  const char* onTheWay(State state) override {
    if (state == initializationMode) return "fmi2ExitInitializationMode";
    return random_.once(4) ? "fmi2SetupExperiment" : "fmi2EnterInitializationMode";
  }
  Attempt make(const Row& r, bool spoil) override;
  Attempt setupExperiment(bool spoil);
  Attempt getReal(bool spoil);
  Attempt setReal(bool spoil);
  Attempt doStep(bool spoil);
  Attempt directional(bool spoil);
  Attempt inputDerivatives(bool spoil);
  Attempt outputDerivatives(bool spoil);
  Attempt statusOf(const std::string& name, bool spoil);
  Attempt otherTypes(const std::string& name, bool spoil);
};

Attempt SequenceOfFmi2::make(const Row& r, bool spoil) {
  const std::string name = r.name;
  if (name == "fmi2SetDebugLogging")
    return setDebugLogging(spoil, [](Session& s, std::uint64_t on, std::size_t count, const char* const* names) -> int {
      return fmi2SetDebugLogging(s.component, static_cast<fmi2Boolean>(on), count, names);
    });
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

Attempt SequenceOfFmi2::setupExperiment(bool spoil) {
  const Times t = times(spoil);
  const double tolerance = random_.once(2) ? nan : 1e-3;
  return {[=](Session& s) { return fmi2SetupExperiment(s.component, fmi2True, tolerance, t.start, t.defined, t.stop); },
          spoil};
}

Attempt SequenceOfFmi2::getReal(bool spoil) {
  References references = some(packed_.readable);
  bool nullReferences = false, nullValues = false;
  if (spoil) {
    references.push_back(unknown());
    nullReferences = random_.once(3);
    nullValues = !nullReferences && random_.once(2);
  }
  return {[=](Session& s) {
            Values values(references.size(), nan);
            const int status = fmi2GetReal(s.component, nullReferences ? nullptr : references.data(), references.size(),
                                           nullValues ? nullptr : values.data());
            if (status == fmi2OK) s.give(values);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi2::setReal(bool spoil) {
  Setting wanted = setting();
  bool nullReferences = false, nullValues = false;
  if (spoil) {
    wanted.refused = true;
    switch (random_.below(4)) {
      case 0:
        wanted.references.push_back(
            random_.once(2) ? unknown() : random_.of(random_.once(2) ? packed_.calculated : packed_.outputs));
        wanted.values.push_back(1);
        break;
      case 1:
        wanted.references.push_back(packed_.inputs[0]);
        wanted.values.push_back(notFinite());
        break;
      default:
        wanted.references.push_back(packed_.inputs[0]);
        wanted.values.push_back(1);
        (random_.once(2) ? nullReferences : nullValues) = true;
    }
    std::swap(wanted.references[random_.below(wanted.references.size())], wanted.references.back());
    if (!std::isfinite(wanted.values.back())) {  // keep the two lists together
      wanted.references = {packed_.inputs[0]};
      wanted.values = {wanted.values.back()};
    }
  }
  return {[=](Session& s) {
            return fmi2SetReal(s.component, nullReferences ? nullptr : wanted.references.data(),
                               wanted.references.size(), nullValues ? nullptr : wanted.values.data());
          },
          wanted.refused};
}

Attempt SequenceOfFmi2::doStep(bool spoil) {
  const Step step = nextStep(spoil);
  after_ = [=, this] { time_ = step.point + step.size; };
  const fmi2Boolean noSetState = static_cast<fmi2Boolean>(random_.below(2));
  return {[=](Session& s) { return fmi2DoStep(s.component, step.point, step.size, noSetState); }, step.refused};
}

Attempt SequenceOfFmi2::directional(bool spoil) {
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
            const int status =
                fmi2GetDirectionalDerivative(s.component, null == 0 ? nullptr : unknowns.data(), unknowns.size(),
                                             null == 1 ? nullptr : knowns.data(), knowns.size(),
                                             null == 2 ? nullptr : change.data(), null == 3 ? nullptr : changes.data());
            if (status == fmi2OK) s.give(changes);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi2::inputDerivatives(bool spoil) {
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

Attempt SequenceOfFmi2::outputDerivatives(bool spoil) {
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
            const int status =
                fmi2GetRealOutputDerivatives(s.component, null == 0 ? nullptr : references.data(), references.size(),
                                             null == 1 ? nullptr : orders.data(), null == 2 ? nullptr : values.data());
            if (status == fmi2OK) s.give(values);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi2::statusOf(const std::string& name, bool spoil) {
  const auto kind = static_cast<fmi2StatusKind>(random_.below(4));
  const auto number = [&](auto begin, auto function) -> Attempt {
    return {[=](Session& s) {
              auto value = begin;
              const int status = function(s.component, kind, spoil ? nullptr : &value);
              s.give(&value, sizeof value);
              return status;
            },
            spoil};
  };
  if (name == "fmi2GetRealStatus") return number(fmi2Real{-1}, fmi2GetRealStatus);
  if (name == "fmi2GetBooleanStatus") return number(fmi2Boolean{-1}, fmi2GetBooleanStatus);
  // The others have no value to give, whatever is asked: they write nowhere.
  if (name == "fmi2GetIntegerStatus")
    return {[=](Session& s) { return fmi2GetIntegerStatus(s.component, kind, nullptr); }};
  if (name == "fmi2GetStringStatus")
    return {[=](Session& s) { return fmi2GetStringStatus(s.component, kind, nullptr); }};
  return {[=](Session& s) { return fmi2GetStatus(s.component, kind, nullptr); }};
}

Attempt SequenceOfFmi2::otherTypes(const std::string& name, bool spoil) {
  const std::size_t count = spoil ? 1 + random_.below(3) : 0;
  const bool null = random_.once(2);
  return {[=](Session& s) {
            const References list(count, 0);
            std::vector<fmi2Integer> numbers(count);
            std::vector<fmi2String> texts(count);
            const std::uint32_t* references = null ? nullptr : list.data();
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

}  // namespace

std::unique_ptr<Sequence> sequenceOfFmi2(const Packed& packed, const Packed& other, std::uint64_t seed,
                                         std::map<std::string, Count>& counts) {
  return std::make_unique<SequenceOfFmi2>(packed, other, seed, counts);
}
