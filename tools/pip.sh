#!/usr/bin/env bash
# Installs into .venv what is named, and says in one line what kept it from being installed.
set -euo pipefail
cd "$(dirname "$0")/.."
log=$(mktemp)
trap 'rm -f "$log"' EXIT
.venv/bin/python -m pip install -q --disable-pip-version-check "$@" >"$log" 2>&1 && exit 0
if grep -qE 'NameResolution|NewConnection|ConnectTimeout|ReadTimeout|ProxyError|Network is unreachable' "$log"; then
    echo "pip cannot reach the package index. Check the network and its proxy (HTTPS_PROXY, PIP_INDEX_URL), then run the same again." >&2
elif grep -q 'No space left on device' "$log"; then
    echo "The disk is full. Free 2 GB for $PWD/.venv, then run the same again." >&2
else
    cat "$log" >&2
    echo "pip could not install $*. What it said stands above." >&2
fi
exit 1
