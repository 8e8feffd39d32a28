#include "saved_state.hpp"

#include <bit>
#include <cereal/archives/portable_binary.hpp>
#include <cmath>
#include <cstring>
#include <ostream>

#include "bytes.hpp"

namespace tiefmu {
namespace {

constexpr std::string_view magic = "tiefmu state\n";
constexpr std::uint32_t formatVersion = 4;  // raise it whenever `fields` or the layout of the array changes
constexpr std::size_t headerSize = magic.size() + 4 + 8 + 8;

// Four chains of h = rotl(h ^ word) * odd, which run at memory bandwidth. Each is one to one in every word, so that a
// change of one word never goes unseen. Against damage in transport, not against intent.
std::uint64_t checksum(std::string_view bytes) {
  constexpr std::uint64_t odd = 0x9e3779b97f4a7c15;
  std::uint64_t chain[4] = {1, 2, 3, 4};
  const auto mix = [](std::uint64_t& h, std::uint64_t word) { h = std::rotl(h ^ word, 29) * odd; };
  const auto wordAt = [&](std::size_t at, std::size_t count) {
    unsigned char raw[8] = {};
    std::memcpy(raw, bytes.data() + at, count);
    if constexpr (std::endian::native == std::endian::little) return std::bit_cast<std::uint64_t>(raw);
    std::uint64_t word = 0;
    for (int i = 0; i < 8; ++i) word |= static_cast<std::uint64_t>(raw[i]) << (8 * i);
    return word;
  };
  std::size_t at = 0;
  for (; at + 32 <= bytes.size(); at += 32)
    for (std::size_t k = 0; k < 4; ++k) mix(chain[k], wordAt(at + 8 * k, 8));
  for (; at < bytes.size(); at += 8) mix(chain[0], wordAt(at, std::min<std::size_t>(8, bytes.size() - at)));
  std::uint64_t hash = bytes.size();
  for (std::uint64_t h : chain) mix(hash, h);
  return hash;
}

// A stream's buffer that writes to [to, to + room), or only counts where `to` is null.
struct Sink : std::streambuf {
  Sink(char* begin, std::size_t size) : to(begin), room(size) {}
  char* to;
  std::size_t room, count = 0;

 protected:
  std::streamsize xsputn(const char* from, std::streamsize n) override {
    const std::size_t size = static_cast<std::size_t>(n);
    if (to) {
      if (size > room - count) return 0;
      std::memcpy(to + count, from, size);
    }
    count += size;
    return n;
  }
  int overflow(int c) override {
    const char byte = static_cast<char>(c);
    return xsputn(&byte, 1) == 1 ? c : traits_type::eof();
  }
};

// What is stored, once for both directions. `length` makes room for that many numbers when it reads.
template <class Archive, class Saved, class Length> void fields(Archive& archive, Saved& s, Length length) {
  const auto sized = [&](auto& array) {
    std::uint64_t count = array.size();
    archive(count);
    length(array, count);
  };
  auto state = static_cast<std::uint32_t>(s.state);
  auto stopDefined = static_cast<std::uint8_t>(s.clock.stopDefined);
  archive(state, s.clock.time, s.clock.stop, stopDefined);
  archive(s.simulation.time, s.simulation.substeps, s.simulation.flags);
  sized(s.simulation.inputs);
  for (auto& derivative : s.simulation.inputs) {
    auto place = static_cast<std::uint64_t>(derivative.place);
    archive(place, derivative.first, derivative.second);
    if constexpr (!std::is_const_v<Saved>) derivative.place = static_cast<std::size_t>(place);
  }
  sized(s.simulation.data);
  archive(cereal::binary_data(s.simulation.data.data(), s.simulation.data.size() * sizeof(double)));
  if constexpr (!std::is_const_v<Saved>) {
    s.state = static_cast<State>(state);
    s.clock.stopDefined = stopDefined != 0;
  }
}

// Bytes behind the header.
std::size_t writeBody(const SavedState& saved, const std::string& guid, char* to, std::size_t room) {
  Sink sink(to, room);
  std::ostream stream(&sink);
  cereal::PortableBinaryOutputArchive archive(stream, cereal::PortableBinaryOutputArchive::Options::LittleEndian());
  archive(static_cast<std::uint64_t>(guid.size()), cereal::binary_data(guid.data(), guid.size()));
  fields(archive, saved, [](auto&, std::uint64_t) {});
  return sink.count;
}

void check(const SavedState& s, std::size_t numbers) {
  const auto require = [](bool condition) {
    if (!condition) throw StateError("the state contradicts itself");
  };
  require(s.simulation.data.size() == numbers);
  switch (s.state) {
    case State::instantiated:
    case State::initialization:
    case State::stepComplete:
    case State::terminated:
    case State::error: break;
    default: require(false);
  }
  require(std::isfinite(s.clock.time) && std::isfinite(s.simulation.time) && !std::isnan(s.clock.stop));
  require(s.simulation.substeps >= 0);
  for (const InputDerivatives& d : s.simulation.inputs) require(std::isfinite(d.first) && std::isfinite(d.second));
}

}  // namespace

std::size_t serializedSize(const SavedState& saved, const std::string& guid) {
  return headerSize + writeBody(saved, guid, nullptr, 0);
}

void serialize(const SavedState& saved, const std::string& guid, char* bytes, std::size_t size) {
  char* body = bytes + headerSize;
  const std::size_t length = writeBody(saved, guid, body, size - headerSize);
  std::string header(magic);
  putNumber(header, formatVersion, 4);
  putNumber(header, length, 8);
  putNumber(header, checksum({body, length}), 8);
  std::memcpy(bytes, header.data(), headerSize);
}

SavedState deserialize(std::string_view bytes, const std::string& guid, std::size_t numbers) {
  if (bytes.substr(0, magic.size()) != magic) throw StateError("these bytes are no state of a tiefmu FMU");
  if (bytes.size() < headerSize) throw StateError("the state is cut short");
  bytes.remove_prefix(magic.size());
  const auto version = takeNumber(bytes, 4);
  if (version != formatVersion)
    throw StateError("the state has format version " + std::to_string(version) + ", this FMU reads version " +
                     std::to_string(formatVersion));
  const auto length = takeNumber(bytes, 8), sum = takeNumber(bytes, 8);
  if (checksums && length != bytes.size())
    throw StateError("the state has " + std::to_string(bytes.size()) + " bytes instead of " + std::to_string(length));
  if (checksums && sum != checksum(bytes)) throw StateError("the state is damaged (checksum)");
  SavedState saved;
  std::string origin;
  View view(bytes);
  std::istream stream(&view);
  try {
    cereal::PortableBinaryInputArchive archive(stream);
    const auto resize = [&](auto& array, std::uint64_t count) {
      // Refused before anything is allocated for it.
      if (count > view.left() / sizeof(array[0])) throw StateError("the state contradicts itself");
      array.resize(static_cast<std::size_t>(count));
    };
    std::uint64_t characters = 0;
    archive(characters);
    resize(origin, characters);
    archive(cereal::binary_data(origin.data(), origin.size()));
    if (origin != guid) throw StateError("the state belongs to another FMU, with GUID '" + printable(origin) + "'");
    fields(archive, saved, resize);
  } catch (const cereal::Exception&) {
    throw StateError("the state is cut short");
  }
  if (view.left() > 0) throw StateError("the state has bytes left over");
  check(saved, numbers);
  return saved;
}

}  // namespace tiefmu
