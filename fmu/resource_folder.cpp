#include "resource_folder.hpp"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "bytes.hpp"

namespace tiefmu {
namespace {

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percentDecoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape =
        text[i] == '%' && i + 2 < text.size() && hexDigit(text[i + 1]) >= 0 && hexDigit(text[i + 2]) >= 0;
    if (!escape) {
      out += text[i];
    } else {
      out += static_cast<char>(16 * hexDigit(text[i + 1]) + hexDigit(text[i + 2]));
      i += 2;
    }
  }
  return out;
}

// file:/path, file:///path, file://localhost/path, or a plain path.
std::string folderOf(const std::string& location) {
  if (location.compare(0, 5, "file:") != 0) {
    if (location.find("://") != std::string::npos)
      throw ResourceError("resource location '" + location + "': only file: locations can be read");
    return location;
  }
  std::string path = location.substr(5);
  if (path.compare(0, 2, "//") == 0) {
    const std::size_t slash = path.find('/', 2);
    const std::string host = path.substr(2, slash == std::string::npos ? slash : slash - 2);
    if (!host.empty() && host != "localhost")
      throw ResourceError("resource location '" + location + "': on another computer, '" + host + "'");
    path = slash == std::string::npos ? "" : path.substr(slash);
  }
  path = percentDecoded(path);
#ifdef _WIN32
  if (path.size() > 2 && path[0] == '/' && path[2] == ':') path.erase(0, 1);  // /C:/folder
#endif
  return path;
}

}  // namespace

std::string resourcePath(const std::string& location, const char* file) {
  return (std::filesystem::path(folderOf(location)) / file).string();
}

Resource loadResource(const std::string& location, const std::string& guid) {
  const std::string path = resourcePath(location, "scene.bin");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw ResourceError("cannot read '" + path + "'");
  const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  Resource resource;
  try {
    resource = readResource(bytes);
  } catch (const ResourceError& e) {
    throw ResourceError("'" + path + "': " + e.what());
  }
  if (resource.guid != guid)
    throw ResourceError("'" + path + "' has GUID '" + printable(resource.guid) + "', the caller expects '" +
                        printable(guid) + "'");
  return resource;
}

}  // namespace tiefmu
