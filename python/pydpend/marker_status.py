"""States of a marker in a frame: their numbers in arrays and their words in tables.

`tracker::observation::Status` of the compiled half has the same.
"""

MISSING, SEEN, REACQUIRED, AMBIGUOUS, UNDECODED, MANUAL = range(6)
"""Numbers in `pydpend.Nodes.status`: not seen; seen; the first frame back; may be it, but another name is possible; the
frame could not be decoded; a person said where it is, or what is it."""

STATUS_WORDS = ("missing", "seen", "reacquired", "ambiguous", "undecoded", "manual")

PLACED = (SEEN, REACQUIRED, MANUAL)
"""States in which the place is known."""
