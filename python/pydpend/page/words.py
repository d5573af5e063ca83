"""Settings and steps in the words of the page."""

from __future__ import annotations

from pydpend.errors import Setting, Step


class PageWords:
    """Settings and steps in messages, as the page calls them."""

    def setting(self, setting: Setting) -> str:
        """The name of the setting on the page, or its keyword where the page has none."""
        name = {
            "marker": "“Follow this” (click the marker in the film)",
            "markers": "“How many markers”",
            "threshold": "“Threshold”",
            "polarity": "“Brighter or darker”",
            "region": "“Part of the picture”",
            "fps": "“Frames a second”",
            "frames": "“Frames”",
        }.get(setting.name, setting.name)
        return name if setting.value is None else f"{name}: {setting.value}"

    def step(self, step: Step) -> str:
        """The command to type."""
        return step.command
