# Configuring and building a preset of CMakePresets.json. Sourced after common.sh.
# shellcheck shell=bash

# Compilers at work at once: one per processor and per 1.5 GB of memory (the largest source needs about that).
build_jobs() {
  local processors gigabytes
  processors=$(nproc)
  gigabytes=$(awk '/^MemAvailable/ {print int($2 / 1500000)}' /proc/meminfo)
  ((gigabytes < 1)) && gigabytes=1
  echo $((processors < gigabytes ? processors : gigabytes))
}

# build_preset PRESET TARGET...
build_preset() {
  local preset=$1
  shift
  mkdir -p build
  # The same source in another folder, or another clone of it, then comes from the cache.
  export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime
  export NINJA_STATUS='   [%f/%t] '
  if [[ ! -f build/$preset/build.ninja ]]; then
    cmake --preset "$preset" > "build/configure-$preset.log" 2>&1 || {
      cat "build/configure-$preset.log" >&2
      fail 1 "configuring the preset '$preset' failed; the reason stands above" "a missing package? scripts/test installs them all"
    }
  fi
  cmake --build --preset "$preset" --parallel "$(build_jobs)" --target "$@" ||
    fail 1 "building '$*' failed; the first error stands above" "if memory ran out, close other programs; run this script again to go on where it stopped"
}
