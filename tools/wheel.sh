#!/usr/bin/env bash
# Builds the wheel, installs it into a new environment, and uses it there, away from the source tree:
# the import, a whole film through dp.track, the overlay, and the program pydpend.
set -euo pipefail
cd "$(dirname "$0")/.."
tree=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
.venv/bin/maturin build --release --locked --compatibility linux --out "$work"
wheel=$(echo "$work"/pydpend-*-abi3-*.whl)
[ -f "$wheel" ] || { echo "no abi3 wheel was made: $(ls "$work")" >&2; exit 1; }
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check "$wheel"
cd "$work"
venv/bin/python -I - "$tree/fixtures/demo/drop.mp4" <<'P'
import sys
from pathlib import Path

import pydpend as dp

package = Path(dp.__file__).parent
assert Path(sys.prefix) in package.parents, f"imported from {package}"
assert (package / "py.typed").is_file() and (package / "_native.pyi").is_file()
nodes = dp.track(sys.argv[1], output="t.parquet", frames=(0, 2000), progress=False)
assert nodes.complete and len(nodes) == 2000 and nodes.seen.any()
film = dp.overlay(sys.argv[1], nodes, "t.mp4", every=50, width=320, progress=False)
assert len(film.frame) == 40
print(nodes, dp.read_nodes("t.parquet"), sep="\n")
P
venv/bin/pydpend --version
venv/bin/pydpend track "$tree/fixtures/demo/hanging.mp4" -o h.parquet
venv/bin/pydpend check h.parquet
venv/bin/pydpend export t.parquet -o t.trc
[ -s t.trc ]
echo "$(basename "$wheel"): built, installed and used in a new environment"
