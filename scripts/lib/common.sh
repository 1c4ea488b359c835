# What every script here uses: sourced, never run. Sets `root` to the project's folder and makes it the working folder.
# shellcheck shell=bash
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"
unset DISPLAY   # nothing of ours needs a screen, and nothing may start to

step() { printf '\n== %s   [%d:%02d]\n' "$*" $((SECONDS / 60)) $((SECONDS % 60)); }
say() { printf '   %s\n' "$*"; }

# fail CODE WHAT [REMEDY]...: exit codes as the program's (2 wrong command line, 3 bad or missing input, 1 the rest).
fail() {
  local code=$1 what=$2
  shift 2
  printf '\n%s: %s\n' "scripts/$(basename "$0")" "$what" >&2
  local remedy
  for remedy in "$@"; do printf '   %s\n' "$remedy" >&2; done
  exit "$code"
}

# git_files PATTERN...: into the array `files`, what git tracks or would add. A clone may belong to somebody else (a container's root).
git_files() {
  command -v git > /dev/null || fail 1 "git is absent" "apt-get install --no-install-recommends git"
  mapfile -d '' -t files < <(git -c "safe.directory=$root" ls-files -z --cached --others --exclude-standard -- "$@")
  [[ ${#files[@]} -gt 0 ]] || fail 1 "git lists no files in $root" "checks need a clone of the project, not an unpacked archive"
}

# The comment block at the top of a script is its help.
show_help() { awk 'NR > 1 && !/^#/ {exit} NR > 1 {sub(/^# ?/, ""); print}' "$0"; }
