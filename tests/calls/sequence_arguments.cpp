// Arguments of the calls, sound or spoilt: what both standards have.
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

std::uint32_t Sequence::unknown() {
  const auto count = static_cast<std::uint32_t>(packed_.references());
  return random_.of(References{count, count + 1, ~0u, ~0u - 1, 0x80000000u});
}

Values Sequence::near(const References& references) {
  Values values = packed_.startOf(references);
  const double size = random_.once(30) ? 1e150 : random_.once(10) ? 0 : 1;
  for (double& v : values) v += size * random_.between(-0.3, 0.3);
  return values;
}

double Sequence::notFinite() { return random_.of(Values{nan, -nan, infinity, -infinity}); }

Sequence::Setting Sequence::setting() {
  const bool parameters = !packed_.parameters.empty() && random_.once(8);
  const References& from = parameters ? packed_.parameters : packed_.inputs;
  const References references = some(from);
  Values values = near(references);
  if (parameters)
    for (double& v : values) v = random_.once(20) ? random_.of(Values{-1, 0, 1e-300, 1e300}) : random_.between(0.5, 2);
  return {&from, references, values, parameters && !references.empty() && state_ == stepComplete};
}

Attempt Sequence::setDebugLogging(bool spoil, int (*call)(Session&, std::uint64_t, std::size_t, const char* const[])) {
  std::vector<std::string> names;
  for (std::size_t n = random_.below(3); n > 0; --n)
    names.push_back(
        random_.of(std::vector<std::string>{"logStatusError", "logStatusWarning", "logTie", "logStability", "logAll"}));
  const std::size_t kind = random_.below(3);
  if (spoil) names.push_back(kind == 0 ? "" : kind == 1 ? std::string(3000, '%') : "logEvents %s%n");
  const std::uint64_t on = random_.bits();
  const bool null = spoil && random_.once(2), nullName = spoil && random_.once(2);
  return {[=](Session& s) {
            std::vector<const char*> list;
            for (const std::string& n : names) list.push_back(n.c_str());
            if (nullName) list.back() = nullptr;
            return call(s, on, list.size(), null ? nullptr : list.data());
          },
          spoil};
}

Sequence::Times Sequence::times(bool spoil) {
  const double start = random_.of(Values{0, 0, 1, -3, 1e6}), stop = start + random_.of(Values{0.1, 1, 1e3, 0});
  Times t{start, stop, random_.once(2)};
  if (spoil) {
    if (t.defined && random_.once(2))
      t.stop = random_.once(2) ? start - 1 : nan;
    else
      t.start = notFinite();
  }
  after_ = [=, this] {
    time_ = t.start;
    stop_ = t.defined ? t.stop : infinity;
  };
  return t;
}

Sequence::Step Sequence::nextStep(bool spoil) {
  Step s{time_, random_.of(Values{0.001, 0.01, 0.013, 0.1}), false};
  if (spoil) {
    s.refused = true;
    if (random_.once(2))
      s.size = random_.of(Values{0, -0.0, -0.01, nan, infinity, -infinity});
    else
      s.point = random_.of(Values{time_ + 1, time_ - 0.05, nan, infinity, -infinity});
    return s;
  }
  if (random_.once(50)) s.size = random_.of(Values{1e300, 5e-324, 1e-300});  // absurd, but no standard forbids them
  s.refused = s.point + s.size > stop_;
  return s;
}

Attempt Sequence::onStates(const std::string& name, bool spoil) {
  const StateCalls& c = packed_.standard.onStates;
  const std::size_t slot = filled(tested_.saved, name == c.get || name == c.deserialize);
  const std::size_t list = filled(tested_.bytes, name == c.serialize);
  void* const wrong = random_.once(2) ? reinterpret_cast<void*>(std::uintptr_t{8}) : nullptr;
  const bool empty = !tested_.saved[slot];
  if (name == c.get) {
    if (spoil) {
      auto at = std::make_shared<void*>(reinterpret_cast<void*>(std::uintptr_t{8}));
      const bool null = random_.once(2);
      return {[=](Session& s) { return c.getInto(s, null ? nullptr : at.get()); }, true};
    }
    after_ = [=, this] { kept_[slot] = {state_, time_, stop_}; };
    return {[=](Session& s) { return c.getInto(s, &s.saved[slot]); }};
  }
  if (name == c.set) {
    after_ = [=, this] {
      state_ = kept_[slot].state;
      time_ = kept_[slot].time;
      stop_ = kept_[slot].stop;
    };
    return {[=](Session& s) { return c.setTo(s, spoil ? wrong : s.saved[slot]); }, spoil || empty};
  }
  if (name == c.free) {
    if (!spoil) return {[=](Session& s) { return c.freeAt(s, &s.saved[slot]); }};
    return {[=](Session& s) {
              void* handle = reinterpret_cast<void*>(std::uintptr_t{8});
              return c.freeAt(s, &handle);
            },
            true};
  }
  if (name == c.size)
    return {[=](Session& s) {
              std::size_t size = 0;
              const bool null = spoil && wrong;
              const int status = c.sizeOf(s, spoil && !null ? nullptr : s.saved[slot], null ? nullptr : &size);
              s.give(&size, sizeof size);
              return status;
            },
            spoil || empty};
  if (name == c.serialize) {
    after_ = [=, this] { keptBytes_[list] = kept_[slot]; };
    const std::size_t less = spoil ? 1 + random_.below(30) : 0;
    return {[=](Session& s) {
              std::size_t size = 0;
              if (c.sizeOf(s, s.saved[slot], &size) != statusOk) size = 64;
              std::vector<char> bytes(size - less);
              const int status = c.toBytes(s, s.saved[slot], spoil && wrong ? nullptr : bytes.data(), bytes.size());
              // Not the bytes: outputs that nobody has asked for yet may stand there or not.
              s.give(&size, sizeof size);
              if (status == statusOk) s.bytes[list] = bytes;
              return status;
            },
            spoil || empty};
  }
  return onBytes(slot, list, spoil);
}

Attempt Sequence::onBytes(std::size_t slot, std::size_t list, bool spoil) {
  std::vector<char> bytes = tested_.bytes[list];
  bool null = false, refused = bytes.empty();
  if (spoil) {
    refused = true;
    switch (random_.below(5)) {
      case 0: null = true; break;
      case 1: bytes = foreign(); break;
      case 2: bytes.resize(random_.below(bytes.size() + 1)); break;
      case 3:
        for (std::size_t n = random_.below(200); n > 0; --n) bytes.push_back(static_cast<char>(random_.bits()));
        break;
      default:
        if (bytes.empty()) bytes.resize(1 + random_.below(100));
        bytes[random_.below(bytes.size())] ^= static_cast<char>(1 << random_.below(7));
    }
    if (bytes == tested_.bytes[list]) bytes.push_back(0);
  }
  after_ = [=, this] { kept_[slot] = keptBytes_[list]; };
  const auto fromBytes = packed_.standard.onStates.fromBytes;
  return {[=](Session& s) { return fromBytes(s, null ? nullptr : bytes.data(), bytes.size(), &s.saved[slot]); },
          refused};
}

std::vector<char> Sequence::foreign() {
  Session session(other_);
  bring(session, stepComplete);
  return session.bytes[0];
}
