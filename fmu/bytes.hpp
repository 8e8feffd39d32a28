// Numbers and streams on bytes in memory, for what is written to be read elsewhere.
#pragma once

#include <cstdint>
#include <streambuf>
#include <string>
#include <string_view>

namespace tiefmu {

// Little endian, on every machine.
inline void putNumber(std::string& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 255);
}

inline std::uint64_t takeNumber(std::string_view& in, int bytes) {
  std::uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= static_cast<std::uint64_t>(static_cast<unsigned char>(in[i])) << (8 * i);
  in.remove_prefix(bytes);
  return value;
}

#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
constexpr bool checksums = false;
#else
constexpr bool checksums = true;
#endif

// Bytes from outside as they may stand in a message.
inline std::string printable(std::string bytes) {
  for (char& c : bytes)
    if (c < ' ' || c > '~') c = '?';
  return bytes;
}

// A stream's buffer to read these bytes from.
struct View : std::streambuf {
  explicit View(std::string_view bytes) {
    char* begin = const_cast<char*>(bytes.data());
    setg(begin, begin, begin + bytes.size());
  }
  std::size_t left() const { return static_cast<std::size_t>(egptr() - gptr()); }
};

}  // namespace tiefmu
