# Included by CMake after its own rules for the system. zig is one program with subcommands: rules for archives name both.
set(CMAKE_CXX_ARCHIVE_CREATE "\"${TIEFMU_ZIG}\" ar qc <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_APPEND "\"${TIEFMU_ZIG}\" ar q <TARGET> <OBJECTS>")
set(CMAKE_CXX_ARCHIVE_FINISH "")
