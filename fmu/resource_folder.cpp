#include "resource_folder.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <memory>
#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>
#endif

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

bool isFileScheme(const std::string& location) {
  const char* scheme = "file:";
  for (std::size_t i = 0; i < 5; ++i)
    if (i >= location.size() || (location[i] | (scheme[i] == ':' ? 0 : 0x20)) != scheme[i]) return false;
  return true;
}

#ifdef _WIN32
constexpr bool windows = true;
#else
constexpr bool windows = false;
#endif

bool isDrive(const std::string& text) { return text.size() == 2 && std::isalpha(text[0] & 0x7f) && text[1] == ':'; }

// file:/path, file:///path, file://localhost/path, or a plain path. On Windows also file:///C:/path, file://C:/path and
// file://server/share/path.
std::string folderOf(const std::string& location) {
  if (!isFileScheme(location)) {
    if (location.find("://") != std::string::npos)
      throw ResourceError("resource location '" + location + "': only file: locations can be read");
    return location;
  }
  std::string path = percentDecoded(location.substr(5));  // first, as some importers encode every slash
  if (path.compare(0, 2, "//") == 0) {
    const std::size_t slash = std::min(path.find('/', 2), path.size());
    const std::string host = path.substr(2, slash - 2);
    if (host.empty() || host == "localhost")
      path.erase(0, slash);
    else if (windows && isDrive(host))
      path.erase(0, 2);
    else if (!windows)
      throw ResourceError("resource location '" + location + "': on another computer, '" + host + "'");
  }
  if (windows && path.size() > 2 && path[0] == '/' && isDrive(path.substr(1, 2))) path.erase(0, 1);
  return path;
}

#ifdef _WIN32
// UTF-8, whatever the code page; of any length, which asks for a full path with the prefix \\?\.
std::FILE* openToRead(const std::string& path) {
  const auto wide = [](const std::string& text) {
    const int size = static_cast<int>(text.size());
    std::wstring out(static_cast<std::size_t>(MultiByteToWideChar(CP_UTF8, 0, text.data(), size, nullptr, 0)), L'\0');
    MultiByteToWideChar(CP_UTF8, 0, text.data(), size, out.data(), static_cast<int>(out.size()));
    return out;
  };
  const std::wstring given = wide(path);
  std::wstring full(GetFullPathNameW(given.c_str(), 0, nullptr, nullptr), L'\0');
  full.resize(GetFullPathNameW(given.c_str(), static_cast<DWORD>(full.size()), full.data(), nullptr));
  if (full.compare(0, 4, L"\\\\?\\") != 0)
    full = full.compare(0, 2, L"\\\\") == 0 ? L"\\\\?\\UNC" + full.substr(1) : L"\\\\?\\" + full;
  return _wfopen(full.c_str(), L"rb");
}
#else
std::FILE* openToRead(const std::string& path) { return std::fopen(path.c_str(), "rb"); }
#endif

std::string readFile(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(openToRead(path), std::fclose);
  std::string bytes;
  char piece[1 << 16];
  while (file) {
    const std::size_t n = std::fread(piece, 1, sizeof piece, file.get());
    bytes.append(piece, n);
    if (n < sizeof piece) break;
  }
  if (!file || std::ferror(file.get())) throw ResourceError("cannot read '" + path + "'");
  return bytes;
}

std::string resourcePath(const std::string& location, const char* file) {
  const std::string folder = folderOf(location);
  const bool ends = !folder.empty() && (folder.back() == '/' || (windows && folder.back() == '\\'));
  return folder + (folder.empty() || ends ? "" : "/") + file;
}

}  // namespace

Resource loadResource(const std::string& location, const std::string& guid) {
  const std::string path = resourcePath(location, "scene.bin");
  const std::string bytes = readFile(path);
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
