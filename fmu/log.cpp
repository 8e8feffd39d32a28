#include "log.hpp"

#include <algorithm>
#include <iterator>
#include <string>

#include "../modelDescription/xml.hpp"
#include "refused.hpp"

namespace tiefmu {

static_assert(std::size(logCategories) == static_cast<std::size_t>(Category::all) + 1, "one name a category, in order");

void Log::choose(bool switchedOn, std::size_t count, const char* const names[]) {
  unsigned chosen = count == 0 ? ~0u : 0u;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = names && names[i] ? names[i] : "";
    const auto* found = std::find_if(std::begin(logCategories), std::end(logCategories),
                                     [&](const LogCategory& c) { return name == c.name; });
    if (found == std::end(logCategories)) throw Refused("unknown log category '" + name + "'");
    const auto category = static_cast<Category>(found - std::begin(logCategories));
    chosen |= category == Category::all ? ~0u : 1u << static_cast<unsigned>(category);
  }
  on = switchedOn;
  categories_ = chosen;
}

void Log::write(Severity severity, Category category, const char* message) const noexcept {
  if (severity == Severity::error || wants(category))
    send(severity, logCategories[static_cast<std::size_t>(category)].name, message);
}

}  // namespace tiefmu
