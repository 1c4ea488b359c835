# Debian packages: what is missing, how large it is, installing it. Sourced after common.sh.
# shellcheck shell=bash

# The names in a list: one per line, '#' starts a comment.
package_names() { sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$1"; }

# Those of the given packages that are not installed.
missing_packages() {
  local installed
  installed=$(dpkg-query -W -f '${db:Status-Abbrev}${Package}\n' 2>/dev/null | awk '/^ii / {print $2}')
  grep -vxF "$installed" < <(printf '%s\n' "$@") || true
}

as_root() {
  if [[ $(id -u) = 0 ]]; then
    "$@"
  elif command -v sudo > /dev/null; then
    sudo "$@"
  else
    fail 1 "installing packages needs root, and there is no sudo here" "as root, run: apt-get install --no-install-recommends ${missing[*]}"
  fi
}

apt() { as_root env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 apt-get -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3 "$@"; }

# A line for every tenth of the packages; everything else goes to the log.
install_progress() {
  awk -v total="$1" -v log_file="$2" '
    { print > log_file }
    /^Unpacking / { unpacked++ }
    /^Setting up / { set_up++ }
    /^(Unpacking|Setting up) / {
      tenth = int(10 * (unpacked + set_up) / (2 * total))
      if (tenth > shown) { shown = tenth; printf "   %3d %%  %d of %d unpacked, %d set up\n", 10 * tenth, unpacked, total, set_up; fflush() }
    }'
}

# Installs those of the given packages that are missing, after saying what they are and how large; quick when none is.
ensure_packages() {
  local missing
  mapfile -t missing < <(missing_packages "$@")
  if [[ ${#missing[@]} = 0 ]]; then
    say "nothing to install: all $# packages are here"
    return
  fi
  command -v apt-get > /dev/null || fail 1 "this is not a Debian system: apt-get is absent" \
    "mapweave is built on Debian 12; elsewhere install what scripts/packages.txt names and run scripts/build"
  say "missing: ${missing[*]}"

  local plan log_file=$root/build/install.log
  mkdir -p "$root/build"
  # Lists that are absent or older than the packages they name make the first try fail; then they are fetched.
  if ! plan=$(LC_ALL=C.UTF-8 apt-get install --no-install-recommends --assume-no "${missing[@]}" 2>&1) && ! grep -q 'newly installed' <<< "$plan"; then
    say "fetching the lists of packages"
    apt update -qq > "$log_file" 2>&1 || fail 1 "apt-get update failed; its last lines:" "$(tail -n 5 "$log_file")" "check the network and /etc/apt/"
    plan=$(LC_ALL=C.UTF-8 apt-get install --no-install-recommends --assume-no "${missing[@]}" 2>&1) || true
  fi
  local count
  count=$(sed -n 's/.* \([0-9]*\) newly installed.*/\1/p' <<< "$plan")
  [[ -n $count ]] || fail 1 "apt-get cannot install them:" "$(grep -E '^E:|^ ' <<< "$plan" | head -n 12)" "mapweave is built on Debian 12 (bookworm)"
  say "about to install $count packages: $(sed -n 's/^Need to get \(.*\) of archives.*/\1 to fetch/p' <<< "$plan"), $(sed -n 's/^After this operation, \(.*\) of additional.*/\1 on disk/p' <<< "$plan")"
  apt install -y -q --no-install-recommends "${missing[@]}" 2>&1 < /dev/null | install_progress "$count" "$log_file" ||
    fail 1 "apt-get failed; its last lines (all: $log_file):" "$(tail -n 8 "$log_file")" "often a mirror that is out of step: run 'apt-get update' and try again"
}

# PCL's headers, out of the package libpcl-dev without installing it (see scripts/packages.txt).
ensure_pcl_headers() {
  local goal=$root/build/packages/libpcl-dev
  [[ ! -d /usr/include/pcl-1.13 && ! -d $goal ]] || return 0
  say "unpacking the headers of libpcl-dev into build/packages (1 MB)"
  rm -rf "$goal.partial"
  mkdir -p "$goal.partial"
  local log_file=$root/build/install.log
  (cd "$goal.partial" && apt-get -o APT::Sandbox::User=root download -q libpcl-dev > "$log_file" 2>&1 && dpkg-deb -x libpcl-dev_*.deb .) ||
    fail 1 "libpcl-dev cannot be fetched:" "$(tail -n 5 "$log_file")" "run 'apt-get update' as root and try again"
  rm -f "$goal.partial"/*.deb
  mv "$goal.partial" "$goal"
}

# A NATS server of today beside Debian's, for tests of both, where there is a Go that can build it; without one those tests are skipped.
ensure_current_broker() {
  local version=v2.12.12 folder=$root/build/packages/nats-server
  [[ ! -x $folder/nats-server ]] || return 0
  local go log_file=$root/build/install.log
  go=$(command -v go || echo /usr/local/go/bin/go)
  if ! "$go" version 2> /dev/null | grep -qE 'go(1\.(2[4-9]|[3-9][0-9])|[2-9])'; then
    say "no Go of 1.24 or newer is here: tests with a current nats-server are skipped"
    return 0
  fi
  say "building nats-server $version from its Go module into build/packages (a minute)"
  mkdir -p "$folder"
  GOBIN=$folder "$go" install "github.com/nats-io/nats-server/v2@$version" > "$log_file" 2>&1 ||
    say "it cannot be built, and tests with it are skipped: $(tail -n 1 "$log_file")"
}

# All that building, testing and running needs.
ensure_all_packages() {
  local names
  mapfile -t names < <(package_names "$root/scripts/packages.txt")
  ensure_packages "${names[@]}"
  ensure_pcl_headers
}
