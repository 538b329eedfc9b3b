#!/usr/bin/env bash
# Makes sure that there is a Vulkan loader and at least one driver, so that wgpu finds an adapter.
#
# Does nothing, quickly, where both are there (a graphics card's driver or Mesa's software one), on macOS (wgpu uses
# Metal there), and with COLLAPSAR_NO_GPU=1. Otherwise, as root on a system with apt-get, it installs Debian's
# mesa-vulkan-drivers (which has a software driver) and libvulkan1; elsewhere it says what to install and ends with 1.
set -euo pipefail

readonly packages="mesa-vulkan-drivers libvulkan1"

has_loader() {
    local ldconfig
    ldconfig=$(PATH="$PATH:/sbin:/usr/sbin" command -v ldconfig) || return 1
    # Not piped into grep -q: that would end ldconfig early, which pipefail takes for a failure.
    [[ $("$ldconfig" -p 2>/dev/null) == *libvulkan.so.1* ]]
}

has_driver() {
    # These variables name driver files, with colons between, and replace the search.
    local named="${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}" file
    if [[ -n "$named" ]]; then
        local -a files
        IFS=: read -ra files <<<"$named"
        for file in "${files[@]}"; do [[ -e "$file" ]] && return 0; done
        return 1
    fi
    for file in {/usr/share,/usr/local/share,/etc,"${XDG_DATA_HOME:-${HOME:-/nonexistent}/.local/share}"}/vulkan/icd.d/*.json; do
        [[ -e "$file" ]] && return 0
    done
    return 1
}

present() { has_loader && has_driver; }

say_what_is_missing() {
    echo "ensure-vulkan: no Vulkan loader and driver were found, and $1." >&2
    echo "ensure-vulkan: install your graphics card's Vulkan driver, or a software one; on Debian and Ubuntu:" >&2
    echo "    sudo apt-get install $packages" >&2
    exit 1
}

if [[ "${COLLAPSAR_NO_GPU:-}" == 1 || "$(uname -s)" == Darwin ]] || present; then
    exit 0
fi
[[ -n "$(command -v apt-get)" ]] || say_what_is_missing "there is no apt-get to install them with"
[[ "$(id -u)" == 0 ]] || say_what_is_missing "only root may install them"

echo "ensure-vulkan: no Vulkan loader and driver were found; installing $packages with apt-get" >&2
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq </dev/null || echo "ensure-vulkan: apt-get update failed; trying with the lists at hand" >&2
# shellcheck disable=SC2086 # two packages, two words
apt-get install -y -qq --no-install-recommends $packages </dev/null >&2
present || say_what_is_missing "installing $packages did not help"
