#!/usr/bin/env bash
# Makes .venv with what the package needs, the package itself from the source tree, and the program pydpend.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    echo "$python is not Python 3.11 or later. Install it, or name one: make PYTHON=python3.11 ..." >&2
    exit 1
fi
# Of an environment that was not made whole, nothing is kept.
.venv/bin/python -m pip --version >/dev/null 2>&1 || rm -rf .venv
if [ ! -e .venv ] && ! said=$("$python" -m venv .venv 2>&1); then
    rm -rf .venv
    echo "$python cannot make .venv ($(tail -n 1 <<<"$said")). Install python3-venv, or free some space." >&2
    exit 1
fi
tools/pip.sh "pip>=25.1"
# The package's own dependencies, read from where they are written down.
.venv/bin/python - >.venv/requirements.txt <<'P'
import tomllib
with open("pyproject.toml", "rb") as f:
    print("\n".join(tomllib.load(f)["project"]["dependencies"]))
P
tools/pip.sh -r .venv/requirements.txt
# From the source tree: the compiled half is copied beside it by `make build`.
site=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
echo "$PWD/python" >"$site/pydpend-tree.pth"
cat >.venv/bin/pydpend <<P
#!$PWD/.venv/bin/python
import sys
from pydpend.cli import main
sys.exit(main())
P
chmod +x .venv/bin/pydpend
