#!/usr/bin/env bash
# Makes sure that there is a C++ compiler: the build compiles meshoptimizer, which is written in C++.
#
# Does nothing, quickly, where CXX names one or there is a c++. Otherwise, as root on a system with
# apt-get, it installs Debian's g++; elsewhere it says what to install and ends with 1.
set -euo pipefail

readonly package="g++"

present() {
    # CXX may be a compiler with its flags, or behind a cache: its first word counts.
    local -a named
    read -ra named <<<"${CXX:-}"
    if [[ ${#named[@]} -gt 0 ]]; then
        [[ -n "$(command -v "${named[0]}")" ]]
    else
        # The build asks for c++ on every Unix; a g++ without that name would not be found.
        [[ -n "$(command -v c++)" ]]
    fi
}

say_what_is_missing() {
    echo "ensure-cxx: no C++ compiler was found (${CXX:-c++}), and $1." >&2
    echo "ensure-cxx: install one; on Debian and Ubuntu:" >&2
    echo "    sudo apt-get install $package" >&2
    exit 1
}

if present; then
    exit 0
fi
[[ -z "${CXX:-}" ]] || say_what_is_missing "CXX names one that is not there: unset it, or correct it"
[[ -n "$(command -v apt-get)" ]] || say_what_is_missing "there is no apt-get to install it with"
[[ "$(id -u)" == 0 ]] || say_what_is_missing "only root may install it"

echo "ensure-cxx: no C++ compiler was found; installing $package with apt-get" >&2
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq </dev/null || echo "ensure-cxx: apt-get update failed; trying with the lists at hand" >&2
apt-get install -y -qq --no-install-recommends "$package" </dev/null >&2
present || say_what_is_missing "installing $package did not help"
