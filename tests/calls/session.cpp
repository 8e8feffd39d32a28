#include "session.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>

#include "../../fmu/resource.hpp"
#include "../../modelDescription/arrays.hpp"
#include "memory.hpp"

void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::_Exit(1);
}

void require(bool truth, const std::string& what) {
  if (!truth) fail(what);
}

Values wave(std::size_t count, int step) {
  Values values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = 0.05 * static_cast<double>((7 * i + 3 * step) % 11) - 0.25;
  return values;
}

Values inputs(const Packed& packed, int step) {
  Values values = packed.startOf(packed.inputs);
  const Values moved = wave(values.size(), step);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += moved[i];
  return values;
}

Packed::Packed(std::string where, const Standard& by) : folder(std::move(where)), path(folder + "/"), standard(by) {
  std::ifstream stream(folder + "/scene.bin", std::ios::binary);
  const std::string data{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const tiefmu::Resource resource = tiefmu::readResource(data);
  guid = resource.guid;
  const tiefmu::Simulation simulation(std::make_shared<const tiefmu::Model>(resource.model));
  const auto list = [&](tiefmu::Causality causality) -> References& {
    return causality == tiefmu::Causality::input       ? inputs
           : causality == tiefmu::Causality::output    ? outputs
           : causality == tiefmu::Causality::parameter ? parameters
                                                       : calculated;
  };
  const std::vector<tiefmu::Block> blocks = tiefmu::variables(resource.model, simulation.layout());
  if (&standard == &fmi2) {
    for (const tiefmu::Block& b : blocks)
      for (std::uint32_t i = 0; i < b.count(); ++i) add(list(b.causality), 1, simulation.data() + b.place + i);
  } else {
    const tiefmu::Arrays arrays = tiefmu::arraysOf(resource.model, blocks);
    const double time = 0;
    References ofTime;
    add(ofTime, 1, &time);
    for (const tiefmu::Array& a : arrays.arrays) {
      Values values;
      for (const tiefmu::Span& s : a.spans)
        values.insert(values.end(), simulation.data() + s.place, simulation.data() + s.place + s.count);
      add(list(a.causality), values.size(), values.data());
    }
    References ofOthers;
    for (const tiefmu::Elements& e : arrays.elements) {
      add(ofOthers, 0, nullptr);
      others.push_back({ofOthers.back(), std::max(e.ids.size(), e.labels.size()), !e.labels.empty()});
    }
  }
  for (std::size_t r = 0; r + others.size() < references(); ++r) readable.push_back(static_cast<std::uint32_t>(r));
}

void Packed::add(References& list, std::size_t size, const double* values) {
  list.push_back(static_cast<std::uint32_t>(references()));
  start_.insert(start_.end(), values, values + size);
  first_.push_back(start_.size());
}

Values Packed::startOf(const References& of) const {
  Values values;
  for (std::uint32_t r : of)
    if (r < references())
      values.insert(values.end(), start_.begin() + static_cast<std::ptrdiff_t>(first_[r]),
                    start_.begin() + static_cast<std::ptrdiff_t>(first_[r + 1]));
    else
      values.push_back(0);
  return values;
}

Session::Session(const Packed& p, bool logging, bool asked) : packed(p), asks(asked) {
  set = inputs(p, 1);
  const std::size_t knowns = set.size(), unknowns = p.startOf(p.outputs).size();
  read.resize(p.startOf(p.readable).size());
  change = wave(knowns, 2);
  slope = wave(knowns, 3);
  weights = wave(unknowns, 4);
  changes.resize(unknowns);
  gradient.resize(knowns);
  orders.assign(std::max(knowns, unknowns), 1);
  instantiate(logging);
  require(component, packed.folder + ": not instantiated: " + (log.empty() ? "" : log.back().text));
}

Session::~Session() { free(); }

void Session::instantiate(bool logging) { packed.standard.instantiate(*this, packed.guid.c_str(), logging); }

void Session::free() {
  packed.standard.free(*this);
  component = nullptr;
}

void Session::give(const void* data, std::size_t size) {
  const memory::Pause pause;
  result.assign(static_cast<const char*>(data), size);
}

const Row& Standard::row(const std::string& name) const {
  for (const Row& r : rows)
    if (r.name == name) return r;
  fail("no row for " + name);
}

int getState(Session& s) { return s.packed.standard.onStates.getInto(s, &s.saved[1]); }
int setState(Session& s) { return s.packed.standard.onStates.setTo(s, s.saved[s.saved[1] ? 1 : 0]); }
int freeState(Session& s) { return s.packed.standard.onStates.freeAt(s, &s.saved[0]); }
int serializedSize(Session& s) {
  std::size_t size = 0;
  const int status = s.packed.standard.onStates.sizeOf(s, s.saved[0], &size);
  s.give(&size, sizeof size);
  return status;
}
int serialize(Session& s) {
  const int status = s.packed.standard.onStates.toBytes(s, s.saved[0], s.buffer.data(), s.buffer.size());
  s.give(s.buffer);
  return status;
}
int deserialize(Session& s) {
  return s.packed.standard.onStates.fromBytes(s, s.bytes[0].data(), s.bytes[0].size(), &s.saved[2]);
}

void bring(Session& session, State state) {
  const Standard& by = session.packed.standard;
  const auto must = [&](int status) {
    require(status == statusOk, std::string("on the way to state ") + by.stateName[state] + ": " +
                                    (session.log.empty() ? "" : session.log.back().text));
  };
  if (state != instantiated) must(by.call(session, by.enter));
  if (state == stepComplete || state == terminated) must(by.call(session, by.exit));
  if (state == terminated) must(by.call(session, by.terminate));
  if (state == error) {
    memory::failAfter(0, memory::Throws::badAlloc);
    const int status = getState(session);
    memory::succeedAgain();
    require(status == statusError, "no memory, but no error");
    session.log.clear();
  }
  std::size_t size = 0;
  must(by.onStates.getInto(session, &session.saved[0]));
  must(by.onStates.sizeOf(session, session.saved[0], &size));
  session.bytes[0].resize(size);
  must(by.onStates.toBytes(session, session.saved[0], session.bytes[0].data(), size));
  session.buffer.resize(size);
  session.log.clear();
}

std::string future(Session& session, State state) {
  const Standard& by = session.packed.standard;
  std::string bytes;
  const auto must = [&](int status, const char* what) {
    require(status == statusOk, std::string(what) + ": " + (session.log.empty() ? "" : session.log.back().text));
  };
  const auto read = [&] {
    must(by.call(session, by.get), "reading");
    bytes += session.result;
  };
  const auto run = [&](double time) {
    for (int step = 0; step < 3; ++step) {
      must(by.setInputs(session, inputs(session.packed, step)), "setting");
      must(by.step(session, time, 0.05), "stepping");
      time += 0.05;
      read();
    }
  };
  if (state == instantiated) must(by.call(session, by.enter), "entering");
  read();
  if (state == instantiated || state == initializationMode) must(by.call(session, by.exit), "exiting");
  if (state == instantiated || state == initializationMode || state == stepComplete) run(0);
  must(by.call(session, by.reset), "resetting");
  must(by.call(session, by.enter), "entering");
  must(by.call(session, by.exit), "exiting");
  run(0);
  return bytes;
}
