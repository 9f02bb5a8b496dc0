"""Where the parts of a plan with choices are written, for messages about plans that come from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from robust.errors import Location
from robust.pike_bridge.json_text import JsonPath, Key


@dataclass(frozen=True, slots=True)
class Places:
    """The location of each value of a document by its path, such as `("events", 3, "guard", "x")`."""

    file: str | None = None
    locations: Mapping[JsonPath, Location] = field(default_factory=lambda: MappingProxyType({}))

    def of(self, *path: Key) -> Location | None:
        """The location of a value, or of the innermost value around it that is written; None without a file."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.locations:
                return self.locations[path[:length]]
        return None


NOWHERE: Final = Places()
"""Of plans that were built in memory."""
