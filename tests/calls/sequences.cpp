#include <cstdio>
#include <cstring>

#include "memory.hpp"
#include "sequence.hpp"

void Sequence::run() {
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

const Row& Sequence::next() {
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

std::string Sequence::rerun(Session& session) {
  require(fmi2Reset(session.component) == fmi2OK, "no reset");
  return future(session, instantiated);
}

void Sequence::step(const Row& r) {
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

void Sequence::follow(const Row& r, fmi2Status status) {
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

void Sequence::trace(const Row& r, const Attempt& attempt, State before) {
  char line[300];
  std::snprintf(line, sizeof line, "%s%s, %s in state %s: ", prefix.c_str(), packed_.folder.c_str(), r.name,
                stateName(before));
  where_ = line + std::string(attempt.refused ? "(spoilt) " : "");
}

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
