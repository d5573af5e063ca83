"""States of a marker in a frame: their numbers in arrays and their words in tables.

`tracker::observation::Status` of the compiled half has the same.
"""

MISSING, SEEN, REACQUIRED, AMBIGUOUS, UNDECODED = range(5)
"""Numbers in `pydpend.Nodes.status`: not seen; seen; the first frame back; may be it, but another name is possible; the
frame could not be decoded."""

STATUS_WORDS = ("missing", "seen", "reacquired", "ambiguous", "undecoded")
