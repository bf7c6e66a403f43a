"""What compiles the generated code: a Makefile, and CMake's file."""

from __future__ import annotations

_MAKEFILE = """CFLAGS ?= -std=c99 -O2 -Wall -Wextra -pedantic
SIZE ?= size

{prefix}.o: {prefix}.c {prefix}.h
	$(CC) $(CFLAGS) -c {prefix}.c

{prefix}_test: {prefix}_test.c {prefix}.o
	$(CC) $(CFLAGS) {prefix}_test.c {prefix}.o -o {prefix}_test -lm

# Position-independent, for {prefix}.py.
lib{prefix}.so: {prefix}.c {prefix}.h
	$(CC) $(CFLAGS) -fPIC -shared {prefix}.c -o lib{prefix}.so -lm

.PHONY: test size clean
test: {prefix}_test
	./{prefix}_test

# Bytes of code and constants (text), and of the stack that each function takes.
size: {prefix}.c {prefix}.h
	$(CC) $(CFLAGS) -fstack-usage -c {prefix}.c -o {prefix}.o
	$(SIZE) {prefix}.o
	cut -f 1,2 {prefix}.su

clean:
	rm -rf {prefix}.o {prefix}.su {prefix}_test lib{prefix}.so __pycache__
"""

_CMAKE = """cmake_minimum_required(VERSION 3.16)
project({prefix} LANGUAGES C)

add_library({prefix} {prefix}.c)
target_include_directories({prefix} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_compile_features({prefix} PUBLIC c_std_99)
set_target_properties({prefix} PROPERTIES POSITION_INDEPENDENT_CODE ON)
if(UNIX)
  target_link_libraries({prefix} PUBLIC m)
endif()

# Not where another project takes the library in by add_subdirectory.
if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
  enable_testing()
  add_executable({prefix}_test {prefix}_test.c)
  target_link_libraries({prefix}_test PRIVATE {prefix})
  add_test(NAME {prefix}_test COMMAND {prefix}_test)
endif()
"""


def build_files(prefix: str) -> dict[str, str]:
    """Texts by file name: each compiles the code, and runs its self-test."""
    return {"Makefile": _MAKEFILE.format(prefix=prefix), "CMakeLists.txt": _CMAKE.format(prefix=prefix)}
