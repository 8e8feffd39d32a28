// Arguments of the calls of FMI 3.0, sound or spoilt.
#include "sequence.hpp"

extern "C" {
#include "fmi3Functions.h"
}

namespace {

class SequenceOfFmi3 final : public Sequence {
 public:
  // Every other one is asked in the middle of steps.
  SequenceOfFmi3(const Packed& packed, const Packed& other, std::uint64_t seed, std::map<std::string, Count>& counts)
      : Sequence(packed, other, seed, counts, seed % 2 == 0) {}

 private:
  const char* onTheWay(State state) override {
    return state == instantiated ? "fmi3EnterInitializationMode" : "fmi3ExitInitializationMode";
  }
  Attempt make(const Row& r, bool spoil) override;
  Attempt enterInitializationMode(bool spoil);
  Attempt getFloat64(bool spoil);
  Attempt setFloat64(bool spoil);
  Attempt getOthers(bool labels, bool spoil);
  Attempt doStep(bool spoil);
  Attempt dependencies(bool spoil);
  Attempt derivative(bool adjoint, bool spoil);
  Attempt outputDerivatives(bool spoil);
  std::size_t sizeOf(const References& references) const { return packed_.startOf(references).size(); }
  // Not of these variables, and not even the time.
  std::uint32_t otherThan(const References& list);
};

Attempt SequenceOfFmi3::make(const Row& r, bool spoil) {
  const std::string name = r.name;
  if (name == "fmi3SetDebugLogging")
    return setDebugLogging(spoil, [](Session& s, std::uint64_t on, std::size_t count, const char* const* names) -> int {
      return fmi3SetDebugLogging(s.component, on % 2 == 0, count, names);
    });
  if (name == "fmi3EnterInitializationMode") return enterInitializationMode(spoil);
  if (name == "fmi3GetFloat64") return getFloat64(spoil);
  if (name == "fmi3SetFloat64") return setFloat64(spoil);
  if (name == "fmi3GetInt64" || name == "fmi3GetString") return getOthers(name == "fmi3GetString", spoil);
  if (name == "fmi3DoStep") return doStep(spoil);
  if (name.find("FMUState") != std::string::npos) return onStates(name, spoil);
  if (name == "fmi3GetVariableDependencies") return dependencies(spoil);
  if (name == "fmi3GetDirectionalDerivative") return derivative(false, spoil);
  if (name == "fmi3GetAdjointDerivative") return derivative(true, spoil);
  if (name == "fmi3GetOutputDerivatives") return outputDerivatives(spoil);
  if (name == "fmi3SetInt32" && spoil)
    return {[](Session& s) {
              const fmi3ValueReference one = 1;
              const fmi3Int32 value = 1;
              return fmi3SetInt32(s.component, &one, 1, &value, 1);
            },
            true};
  return {r.call, false};
}

std::uint32_t SequenceOfFmi3::otherThan(const References& list) {
  References others = {0};
  for (const Packed::Other& o : packed_.others) others.push_back(o.reference);
  for (const References* l : {&packed_.inputs, &packed_.outputs, &packed_.calculated})
    if (l != &list && !l->empty()) others.push_back(random_.of(*l));
  return random_.of(others);
}

Attempt SequenceOfFmi3::enterInitializationMode(bool spoil) {
  const Times t = times(spoil);
  const bool tolerant = random_.once(2);
  return {[=](Session& s) {
            return fmi3EnterInitializationMode(s.component, tolerant, tolerant ? nan : 1e-3, t.start, t.defined,
                                               t.stop);
          },
          spoil};
}

Attempt SequenceOfFmi3::getFloat64(bool spoil) {
  References references = some(packed_.readable);
  std::size_t size = sizeOf(references);
  bool nullReferences = false, nullValues = false;
  if (spoil) {
    references.push_back(packed_.outputs[0]);
    size += sizeOf({packed_.outputs[0]});
    switch (random_.below(4)) {
      case 0: references.back() = random_.once(2) ? unknown() : packed_.others[0].reference; break;
      case 1: size += random_.once(2) ? 1 : ~std::size_t{0}; break;
      case 2: nullReferences = true; break;
      default: nullValues = true;
    }
  }
  return {[=](Session& s) {
            Values values(size, nan);
            const int status = fmi3GetFloat64(s.component, nullReferences ? nullptr : references.data(),
                                              references.size(), nullValues ? nullptr : values.data(), values.size());
            if (status == statusOk) s.give(values);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi3::setFloat64(bool spoil) {
  Setting wanted = setting();
  bool nullReferences = false, nullValues = false;
  if (spoil) {
    wanted.refused = true;
    wanted.references.push_back(packed_.inputs[0]);
    const Values more = packed_.startOf({packed_.inputs[0]});
    wanted.values.insert(wanted.values.end(), more.begin(), more.end());
    switch (random_.below(5)) {
      case 0:
        wanted.references[random_.below(wanted.references.size())] =
            random_.once(2) ? unknown() : otherThan(*wanted.from);
        break;
      case 1: wanted.values.back() = notFinite(); break;
      case 2:
        if (random_.once(2))
          wanted.values.pop_back();
        else
          wanted.values.push_back(0);
        break;
      case 3: nullReferences = true; break;
      default: nullValues = true;
    }
  }
  return {[=](Session& s) {
            return fmi3SetFloat64(s.component, nullReferences ? nullptr : wanted.references.data(),
                                  wanted.references.size(), nullValues ? nullptr : wanted.values.data(),
                                  wanted.values.size());
          },
          wanted.refused};
}

Attempt SequenceOfFmi3::getOthers(bool labels, bool spoil) {
  References references;
  std::size_t size = 0;
  for (std::size_t n = random_.below(3); n > 0; --n) {
    const Packed::Other& o = random_.of(packed_.others);
    if (o.labels != labels) continue;
    references.push_back(o.reference);
    size += o.size;
  }
  bool null = false;
  if (spoil) switch (random_.below(3)) {
      case 0: references.push_back(random_.once(2) ? unknown() : random_.of(packed_.readable)); break;
      case 1: ++size; break;
      default: references.push_back(packed_.others[0].reference); null = true;
    }
  return {[=](Session& s) {
            const std::uint32_t* list = null ? nullptr : references.data();
            if (labels) {
              std::vector<fmi3String> texts(size);
              return fmi3GetString(s.component, list, references.size(), texts.data(), size);
            }
            std::vector<fmi3Int64> ids(size);
            const fmi3Status status = fmi3GetInt64(s.component, list, references.size(), ids.data(), size);
            if (status == fmi3OK) s.give(ids);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi3::doStep(bool spoil) {
  Step step = nextStep(spoil);
  double returns = infinity;
  if (tested_.asks && !step.refused && random_.once(3)) {  // long enough to be asked
    step.size = random_.between(1, 2);
    step.refused = step.point + step.size > stop_;
    if (random_.once(2)) returns = step.point + random_.between(0, step.size);
  }
  const bool null = spoil && random_.once(4);
  after_ = [this] { time_ = tested_.end; };
  return {[=](Session& s) -> int {
            if (null)
              return fmi3DoStep(s.component, step.point, step.size, fmi3False, nullptr, nullptr, nullptr, nullptr);
            s.returns = returns;
            const int status = fmi3.step(s, step.point, step.size);
            s.give(&s.end, sizeof s.end);
            return status;
          },
          step.refused};
}

Attempt SequenceOfFmi3::dependencies(bool spoil) {
  std::uint32_t reference = random_.of(random_.once(4) ? packed_.inputs : packed_.outputs);
  int null = -1;
  bool wrongCount = false;
  if (spoil) switch (random_.below(3)) {
      case 0: reference = unknown(); break;
      case 1: wrongCount = true; break;
      default: null = static_cast<int>(random_.below(4));
    }
  std::size_t some = 0;  // null pointers are right where there are none
  fmi3GetNumberOfVariableDependencies(tested_.component, reference, &some);
  const bool refused = spoil && (null < 0 || some > 0);
  return {[=](Session& s) {
            std::size_t count = 0;
            fmi3GetNumberOfVariableDependencies(s.component, reference, &count);
            count += wrongCount;
            std::vector<std::size_t> dependent(count), independent(count);
            References variables(count);
            std::vector<fmi3DependencyKind> kinds(count);
            const fmi3Status status = fmi3GetVariableDependencies(
                s.component, reference, null == 0 ? nullptr : dependent.data(), null == 1 ? nullptr : variables.data(),
                null == 2 ? nullptr : independent.data(), null == 3 ? nullptr : kinds.data(), count);
            if (status == fmi3OK) s.give(variables);
            return status;
          },
          refused};
}

Attempt SequenceOfFmi3::derivative(bool adjoint, bool spoil) {
  References unknowns = some(packed_.outputs), knowns = some(packed_.inputs);
  int null = -1;
  std::size_t more = 0;
  bool badSeed = false;
  if (spoil) {
    unknowns.push_back(packed_.outputs[0]);
    knowns.push_back(packed_.inputs[0]);
  }
  Values seed = wave(sizeOf(adjoint ? unknowns : knowns), static_cast<int>(random_.below(9)));
  const std::size_t size = sizeOf(adjoint ? knowns : unknowns);
  if (spoil) switch (random_.below(5)) {
      case 0: unknowns.back() = random_.once(2) ? unknown() : otherThan(packed_.outputs); break;
      case 1: knowns.back() = random_.once(2) ? unknown() : otherThan(packed_.inputs); break;
      case 2: more = 1; break;
      case 3: badSeed = true; break;
      default: null = static_cast<int>(random_.below(4));
    }
  if (badSeed) seed[random_.below(seed.size())] = notFinite();
  return {[=](Session& s) {
            Values result(size + more, nan);
            const auto call = adjoint ? fmi3GetAdjointDerivative : fmi3GetDirectionalDerivative;
            const fmi3Status status =
                call(s.component, null == 0 ? nullptr : unknowns.data(), unknowns.size(),
                     null == 1 ? nullptr : knowns.data(), knowns.size(), null == 2 ? nullptr : seed.data(), seed.size(),
                     null == 3 ? nullptr : result.data(), result.size());
            if (status == fmi3OK) s.give(result);
            return status;
          },
          spoil};
}

Attempt SequenceOfFmi3::outputDerivatives(bool spoil) {
  References references = some(packed_.outputs);
  if (spoil) references.push_back(packed_.outputs[0]);
  std::vector<fmi3Int32> orders(references.size(), 1);
  std::size_t size = sizeOf(references);
  int null = -1;
  if (spoil) {
    const std::size_t at = random_.below(references.size());
    switch (random_.below(4)) {
      case 0: references[at] = random_.once(2) ? unknown() : otherThan(packed_.outputs); break;
      case 1: orders[at] = random_.of(std::vector<fmi3Int32>{0, -1, 2, 2147483647}); break;
      case 2: ++size; break;
      default: null = static_cast<int>(random_.below(3));
    }
  }
  return {[=](Session& s) {
            Values values(size, nan);
            const fmi3Status status = fmi3GetOutputDerivatives(s.component, null == 0 ? nullptr : references.data(),
                                                               references.size(), null == 1 ? nullptr : orders.data(),
                                                               null == 2 ? nullptr : values.data(), values.size());
            if (status == fmi3OK) s.give(values);
            return status;
          },
          spoil};
}

}  // namespace

std::unique_ptr<Sequence> sequenceOfFmi3(const Packed& packed, const Packed& other, std::uint64_t seed,
                                         std::map<std::string, Count>& counts) {
  return std::make_unique<SequenceOfFmi3>(packed, other, seed, counts);
}
