# One function per kind of target. They hold the warnings, the arrow check and nothing else.

function(mapweave_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast
    -Woverloaded-virtual -Werror)
endfunction()

# mapweave_add_library(NAME USES <our libraries> SOURCES <files> [PUBLIC <targets>] [PRIVATE <targets>] [PROTOS <files>])
# USES is the exact list of arrows of libs/README.md: a library may use only what stands above it in libs/CMakeLists.txt.
function(mapweave_add_library name)
  cmake_parse_arguments(arg "" "" "USES;SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "libs/${name}: unknown arguments ${arg_UNPARSED_ARGUMENTS}")
  endif()
  foreach(lower IN LISTS arg_USES)
    if(NOT TARGET mapweave::${lower})
      message(FATAL_ERROR "libs/${name} may not use libs/${lower}: it is not above it in libs/CMakeLists.txt")
    endif()
  endforeach()
  mapweave_check_arrows(${name} ${CMAKE_CURRENT_SOURCE_DIR} "${name};${arg_USES}")

  add_library(mapweave_${name} STATIC ${arg_SOURCES})
  add_library(mapweave::${name} ALIAS mapweave_${name})
  target_include_directories(mapweave_${name} PUBLIC include PRIVATE src)
  list(TRANSFORM arg_USES PREPEND mapweave::)
  target_link_libraries(mapweave_${name} PUBLIC ${arg_USES} ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  mapweave_set_warnings(mapweave_${name})
endfunction()

# Fails when a file includes a header of a library that is not among its arrows (transitive ones included:
# what a library uses, it names).
function(mapweave_check_arrows name folder allowed)
  file(GLOB_RECURSE files CONFIGURE_DEPENDS ${folder}/*.h ${folder}/*.cpp)
  foreach(file IN LISTS files)
    file(STRINGS ${file} includes REGEX "^#include [<\"]mapweave/")
    foreach(line IN LISTS includes)
      string(REGEX REPLACE "^#include [<\"]mapweave/([a-z_]+)/.*" "\\1" used "${line}")
      if(NOT used IN_LIST allowed)
        file(RELATIVE_PATH shown ${PROJECT_SOURCE_DIR} ${file})
        message(FATAL_ERROR "${shown}: libs/${name} may not include mapweave/${used}/: add it to USES if the arrow of "
          "libs/README.md allows it")
      endif()
    endforeach()
  endforeach()
endfunction()

# mapweave_compile_quickly(TARGET <arguments of target_precompile_headers>): headers that nearly every source of a kind parses (1 to 3 s
# each) are parsed once, and -O1 is enough: neither verbs nor tests are where time goes at run time. A third less to compile in them (DECISIONS 12).
function(mapweave_compile_quickly target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1> $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)   # the latter is for ccache
  target_precompile_headers(${target} ${ARGN})
endfunction()

# `programs`: what scripts/build makes unless asked otherwise.
add_custom_target(programs)

# mapweave_add_program(NAME USES <our libraries> SOURCES <files> [PRIVATE <targets>]): an executable of apps/.
function(mapweave_add_program name)
  cmake_parse_arguments(arg "" "" "USES;SOURCES;PRIVATE" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  list(TRANSFORM arg_USES PREPEND mapweave::)
  target_link_libraries(${name} PRIVATE ${arg_USES} ${arg_PRIVATE})
  # MRPT's classes register themselves: a program that only reads them must still load the libraries.
  target_link_options(${name} PRIVATE -Wl,--no-as-needed)
  mapweave_set_warnings(${name})
  add_dependencies(programs ${name})
  set_property(GLOBAL APPEND PROPERTY MAPWEAVE_PROGRAMS ${name})
endfunction()

# mapweave_add_test(NAME USES <our libraries> SOURCES <files> [PRIVATE <targets>] [TIMEOUT seconds] [WHOLE_SUITES <suites>] [SERIAL]): one
# gtest executable per library. Each test is a process, but those of each of WHOLE_SUITES are one: they share what is slow to prepare. SERIAL: while
# one runs, no other test does.
function(mapweave_add_test name)
  cmake_parse_arguments(arg "SERIAL" "TIMEOUT" "USES;SOURCES;PRIVATE;WHOLE_SUITES" ${ARGN})
  add_executable(${name}_test ${arg_SOURCES})
  mapweave_compile_quickly(${name}_test REUSE_FROM mapweave_test_headers)
  list(TRANSFORM arg_USES PREPEND mapweave::)
  target_link_libraries(${name}_test PRIVATE ${arg_USES} mapweave_test_support ${arg_PRIVATE} GTest::gmock GTest::gtest_main)
  target_link_options(${name}_test PRIVATE -Wl,--no-as-needed)
  mapweave_set_warnings(${name}_test)
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  if(MAPWEAVE_SANITIZER)
    math(EXPR arg_TIMEOUT "6 * ${arg_TIMEOUT}")
  endif()
  include(GoogleTest)
  foreach(suite IN LISTS arg_WHOLE_SUITES)
    add_test(NAME ${suite} COMMAND ${name}_test --gtest_filter=${suite}.*)
    set_tests_properties(${suite} PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS ${name})
  endforeach()
  if(arg_WHOLE_SUITES)
    list(JOIN arg_WHOLE_SUITES ".*:" whole)
    set(one_by_one TEST_FILTER "-${whole}.*")
  endif()
  gtest_discover_tests(${name}_test DISCOVERY_TIMEOUT 60 ${one_by_one}
    PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS ${name} RUN_SERIAL ${arg_SERIAL})
endfunction()

# mapweave_add_benchmark(NAME USES ... SOURCES ...): built with the rest, run by scripts/bench, never by ctest.
function(mapweave_add_benchmark name)
  cmake_parse_arguments(arg "" "" "USES;SOURCES;PRIVATE" ${ARGN})
  add_executable(${name}_benchmark ${arg_SOURCES})
  list(TRANSFORM arg_USES PREPEND mapweave::)
  target_link_libraries(${name}_benchmark PRIVATE ${arg_USES} ${arg_PRIVATE})
  target_link_options(${name}_benchmark PRIVATE -Wl,--no-as-needed)
  mapweave_set_warnings(${name}_benchmark)
endfunction()
