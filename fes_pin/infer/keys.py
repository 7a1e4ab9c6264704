"""Names of candidates: what acts, where it acts, and in which group of the data."""

from __future__ import annotations

from typing import NamedTuple


class Key(NamedTuple):
    """A candidate. Its text is `name`, `name@site`, `name:group` or `name@site:group`.

    Attributes
    ----------
    name
        What acts: a cause, or a nominal parameter that differs.
    site
        Where it acts; empty where there is one place.
    group
        The group of the data that it concerns; empty where it concerns all.
    """

    name: str
    site: str = ""
    group: str = ""

    def __str__(self) -> str:
        return self.name + f"@{self.site}" * bool(self.site) + f":{self.group}" * bool(self.group)

    @classmethod
    def of(cls, text: str) -> Key:
        """Return the candidate of a text."""
        place, _, group = text.partition(":")
        name, _, site = place.partition("@")
        return cls(name, site, group)
