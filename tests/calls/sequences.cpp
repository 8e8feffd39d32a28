#include <cstdio>
#include <cstring>

#include "memory.hpp"
#include "sequence.hpp"

void Sequence::run() {
  const std::size_t length = 5 + random_.below(40);
  for (std::size_t i = 0; i < length; ++i) {
    step(next());
  }
  const Standard& by = packed_.standard;
  if (state_ != instantiated)
    require(by.call(tested_, by.get) == by.call(twin_, by.get) && (tested_.result == twin_.result || state_ == error),
            where_ + "refused calls have changed values");
  require(rerun(tested_) == rerun(twin_), where_ + "another run after a reset");
}

const Row& Sequence::next() {
  const Standard& by = packed_.standard;
  if (random_.once(2)) return random_.of(by.rows);
  switch (state_) {
    case instantiated:
    case initializationMode: return by.row(onTheWay(state_));
    case stepComplete: return by.row(random_.of(by.running));
    default: return random_.once(4) ? by.row(by.onStates.set) : random_.of(by.rows);
  }
}

std::string Sequence::rerun(Session& session) {
  const Standard& by = session.packed.standard;
  session.intrudes = false;
  require(by.call(session, by.reset) == statusOk, "no reset");
  return future(session, instantiated);
}

void Sequence::step(const Row& r) {
  const State before = state_;
  after_ = nullptr;
  Attempt attempt = make(r, random_.once(4));
  const bool nowhere = random_.once(60);  // no instance at all
  const bool refused = nowhere || attempt.refused || !r.with(before);
  if (nowhere) {
    void* const component = tested_.component;
    tested_.component = nullptr;
    require(attempt.call(tested_) == statusError, std::string(r.name) + ": no instance, but no error");
    tested_.component = component;
    return;
  }
  trace(r, attempt, before);
  tested_.log.clear();
  tested_.result.clear();
  const int status = attempt.call(tested_);
  if (aloud)
    std::fprintf(stderr, "%s status %d%s, %s\n", where_.c_str(), status, refused ? " due" : "",
                 tested_.log.empty() ? "" : tested_.log.back().text.c_str());
  Count& count = counts_[r.name];
  ++(refused ? count.refused : status == statusError ? count.errors : count.good);
  if (refused) require(status == statusError, where_ + "not refused");
  require(status == statusOk || status == statusError || (status == statusDiscard && !refused),
          where_ + "another status");
  if (status == statusError) {
    require(!tested_.log.empty(), where_ + "an error without a message");
    const Message& last = tested_.log.back();
    require(last.status == statusError && last.category == "logStatusError" &&
                last.text.compare(0, std::strlen(r.name), r.name) == 0 && last.text.find('\n') == std::string::npos,
            where_ + "says '" + last.text + "'");
  }
  if (refused) return;
  twin_.result.clear();
  require(attempt.call(twin_) == status, where_ + "two instances disagree");
  require(tested_.result == twin_.result || before == error, where_ + "two instances give different values");
  follow(r, status);
}

void Sequence::follow(const Row& r, int status) {
  const std::string name = r.name;
  const Standard& by = packed_.standard;
  if (status == statusError) {
    // Refused after all, for a reason that only the FMU knows, or failed: a call that sets nothing tells.
    if (by.fails(tested_, state_)) state_ = error;
    return;
  }
  if (after_) after_();
  if (name == by.enter) {
    state_ = initializationMode;
  } else if (name == by.exit) {
    state_ = stepComplete;
  } else if (name == by.terminate) {
    state_ = terminated;
  } else if (name == by.reset) {
    state_ = instantiated;
    time_ = 0;
    stop_ = infinity;
  }
}

void Sequence::trace(const Row& r, const Attempt& attempt, State before) {
  char line[300];
  std::snprintf(line, sizeof line, "%s%s, %s in state %s: ", prefix.c_str(), packed_.folder.c_str(), r.name,
                packed_.standard.stateName[before]);
  where_ = line + std::string(attempt.refused ? "(spoilt) " : "");
}

std::unique_ptr<Sequence> Sequence::of(const Packed& packed, const Packed& other, std::uint64_t seed,
                                       std::map<std::string, Count>& counts) {
  return (&packed.standard == &fmi2 ? sequenceOfFmi2 : sequenceOfFmi3)(packed, other, seed, counts);
}

void testSequences(const std::vector<Packed>& packed, long count, long first) {
  std::map<std::string, Count> counts;
  for (const Row& r : packed[0].standard.rows) counts[r.name];
  const auto run = [&](long number) {
    const std::size_t scenes = packed.size(), scene = static_cast<std::size_t>(number) % scenes;
    const auto sequence =
        Sequence::of(packed[scene], packed[(scene + 1) % scenes], static_cast<std::uint64_t>(number), counts);
    sequence->prefix = "sequence " + std::to_string(number) + ": ";
    sequence->aloud = count == 1;
    sequence->run();
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
