#!/usr/bin/env bash
# Installs the Debian packages of a list that are missing, or says which to install.
set -euo pipefail
list=$1
wanted=$(grep -vE '^\s*(#|$)' "$list")

if ! command -v dpkg-query >/dev/null; then
    echo "This is not a Debian system. Install what these Debian 12 packages hold, then: make SKIP_SYSTEM=1 ..." >&2
    echo "  $(echo $wanted)" >&2
    exit 1
fi
missing=""
for package in $wanted; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q '^install ok installed' || missing="$missing $package"
done
[ -z "$missing" ] && exit 0

root=""
if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        root=sudo
    else
        echo "These packages are missing and this account cannot install them. Ask for:" >&2
        echo "  apt-get install$missing" >&2
        exit 1
    fi
fi
if ! command -v apt-get >/dev/null; then
    echo "apt-get is not here. Install these packages:$missing" >&2
    exit 1
fi
echo "Installing:$missing"
log=$(mktemp)
if ! { $root apt-get update -q && DEBIAN_FRONTEND=noninteractive $root apt-get install -q -y --no-install-recommends $missing; } >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    echo "apt-get failed. Install these packages:$missing" >&2
    exit 1
fi
rm -f "$log"
