"""The page on which a person sees a film, chooses its markers and corrects them: ``pydpend edit`` and `pydpend.edit`.

Needs the extra ``page``. Nothing imports it but the command line and the package's front.
"""
