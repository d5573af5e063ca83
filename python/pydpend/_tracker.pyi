"""The compiled half of pydpend; private. Everything here is wrapped by a public name."""
