"""The project's tests; a package, because others (sleap-io 0.9) install one of this name."""
