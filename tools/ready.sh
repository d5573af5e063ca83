#!/usr/bin/env bash
# Says in one line what keeps a build from being begun, and what to do. Run by `make build`.
set -euo pipefail
cd "$(dirname "$0")/.."

stop() {
    echo "$1" >&2
    exit 1
}

command -v cargo >/dev/null || stop "cargo is missing. Install Rust with rustup (https://rustup.rs)."
least=$(sed -nE 's/^rust-version = "(.*)"/\1/p' Cargo.toml)
found=$(cargo --version 2>/dev/null | cut -d' ' -f2)
[ "$(printf '%s\n' "$least" "$found" | sort -V | head -n 1)" = "$least" ] ||
    stop "cargo is ${found:-not to be started}, and $least or later is needed. Run: rustup update stable"
for tool in cc pkg-config; do
    command -v $tool >/dev/null || stop "$tool is missing. Install build-essential and pkg-config, or what your system calls them."
done
for library in libavcodec libavformat libavutil libswscale opencv4; do
    pkg-config --exists "$library" ||
        stop "pkg-config does not find $library. Install its development package (tools/system-packages.txt), or set PKG_CONFIG_PATH."
done
[ -w . ] || stop "$PWD cannot be written to. Copy the source to where you may write."
home=${CARGO_HOME:-$HOME/.cargo}
mkdir -p "$home/registry" 2>/dev/null && [ -w "$home/registry" ] ||
    stop "$home cannot be written to, and cargo keeps crates there. Set another folder: export CARGO_HOME=$PWD/target/cargo-home"
# A first build takes 1.4 GB in target and less than 2 GB in .venv.
if [ ! -e target/release/lib_native.so ]; then
    free=$(df -Pk . | awk 'NR == 2 {print $4}')
    [ "$free" -ge "${LEAST_KB:-3500000}" ] ||
        stop "$((free / 1000)) MB are free in $PWD, and a first build takes 3500 MB. Free some space, or set CARGO_TARGET_DIR."
fi
