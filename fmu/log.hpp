// Where an instance's messages go.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tiefmu {

enum class Severity : std::uint8_t { note, warning, error };

// Indexes of logCategories (modelDescription/xml.hpp).
enum class Category : std::uint8_t { error, warning, tie, stability, all };

class Log {
 public:
  virtual ~Log() = default;

  bool on = false;
  // Only these categories, or with count 0 all. Throws Refused for an unknown one.
  void choose(bool switchedOn, std::size_t count, const char* const names[]);
  bool wants(Category category) const { return on && categories_ >> static_cast<unsigned>(category) & 1; }
  // Errors are logged always. Does not throw or allocate.
  void write(Severity severity, Category category, const char* message) const noexcept;

 private:
  // Hands a message to the caller. `category` is one of logCategories.
  virtual void send(Severity severity, const char* category, const char* message) const noexcept = 0;

  unsigned categories_ = ~0u;  // bit i: category i
};

}  // namespace tiefmu
