"""Shows a film in the browser: its markers are seen, chosen by clicks, checked and corrected.

Every decision is an entry of NAME.edits.toml beside the film (or in --run). `pydpend track` and `analyse` make the
decisions again with --edits. Only this machine can open the page; it ends when the page is closed, or with Ctrl-C.

  pydpend edit drop.mp4
  pydpend edit drop.mp4 --rig rig.toml --run edited/
"""

from __future__ import annotations

import argparse

HELP = "see a film in the browser, choose its markers by clicks, correct them"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    p.add_argument("film", metavar="FILM", help="the film")
    p.add_argument("--rig", metavar="RIG.toml", help="a rig to begin with; found in the film if not given")
    p.add_argument(
        "--run",
        dest="folder",
        metavar="DIR",
        help="folder for decisions, rig and table (default: where the film is)",
    )
    p.add_argument("--no-browser", action="store_true", help="only print the address")


def run(args: argparse.Namespace) -> int:
    """Serves the page until it is closed."""
    import webbrowser

    from pydpend.errors import ArgumentError
    from pydpend.kinds import expect
    from pydpend.page.opening import opened

    expect(args.film, ("film", "pictures"), ArgumentError)
    if args.rig is not None:
        expect(args.rig, ("rig",), ArgumentError, "rig")
    page = opened(args.film, args.rig, args.folder, framed=False)
    try:
        print(
            f"{page.url}\nOnly this machine can open it. It ends when the page is closed, or with Ctrl-C",
            flush=True,
        )
        if not args.no_browser:
            webbrowser.open(page.url)
        page.wait()
    finally:
        page.close()
    print(f"decisions: {page.edits}")
    return 0
