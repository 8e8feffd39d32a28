// What a fuzzer throws at: bytes from outside, read and then used as far as they go. Whatever they are, nothing may
// crash, hang, or leave the library as an exception.
#pragma once

#include <cstddef>
#include <string>

// The bytes of a resource, resources/scene.bin of an FMU. Whether they are one.
bool takeResource(const unsigned char* bytes, std::size_t size);
// The bytes of a serialised state, for the scene in this file. Whether they are one.
bool takeState(const std::string& scene, const unsigned char* bytes, std::size_t size);
