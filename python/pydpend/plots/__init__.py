"""Figures from results: each function takes a result and returns a matplotlib ``Figure``.

Nothing is computed here.
"""
