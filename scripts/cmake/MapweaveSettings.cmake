# How every target of ours is compiled. Presets (CMakePresets.json) choose build type and sanitizers.
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)

set(MAPWEAVE_SANITIZER "" CACHE STRING "address or thread; empty for none")
set(MAPWEAVE_DATA "${PROJECT_SOURCE_DIR}/../shared/data" CACHE PATH
  "Public logs for tests and benches; tests that need them skip, saying so, where they are absent")
set(MAPWEAVE_FUZZ OFF CACHE BOOL "Build the fuzz targets (test/fuzz) with libFuzzer: clang alone; OFF: with a driver that replays their seeds")
set(MAPWEAVE_ROS AUTO CACHE STRING "Build the nodes of ROS 1 (apps/ros_nodes): ON, OFF, or AUTO (where roscpp is found)")

find_program(MAPWEAVE_CCACHE ccache)
if(MAPWEAVE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${MAPWEAVE_CCACHE})
endif()

# Contracted multiply-adds would make results differ between CPUs (README: the same bytes).
add_compile_options(-ffp-contract=off)
if(MAPWEAVE_SANITIZER STREQUAL "address")
  add_compile_options(-fsanitize=address,undefined -fno-omit-frame-pointer -fno-sanitize-recover=all)
  # Eigen would take memory in another way under this sanitizer than in libraries that are not instrumented, and both share templates
  # (Ceres and ours: sparse Cholesky): what one took, the other would free.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
  add_link_options(-fsanitize=address,undefined)
elseif(MAPWEAVE_SANITIZER STREQUAL "thread")
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer -Wno-maybe-uninitialized)   # gcc 12 takes members of empty optionals for used
  add_link_options(-fsanitize=thread)
elseif(MAPWEAVE_SANITIZER)
  message(FATAL_ERROR "MAPWEAVE_SANITIZER is '${MAPWEAVE_SANITIZER}'; it must be address, thread or empty")
endif()
if(MAPWEAVE_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "MAPWEAVE_FUZZ needs clang, and the compiler is ${CMAKE_CXX_COMPILER_ID}: use the preset fuzz")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link,float-cast-overflow)
endif()
