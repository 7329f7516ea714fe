"""Count things, and show messages of one kind together: the first three, and how many
more there are."""

import re
from collections.abc import Iterable

N_SHOWN = 3
"""Messages of a kind that are shown."""
VARYING = re.compile(r"\S*[/\d]\S*")
"""Words with a digit or a slash: numbers, ids, weeks and paths, in which messages of
one kind differ."""


class Kinds:
    """Messages that come one after another, the distinct `messages` by kind: of each
    kind only the first ones are shown."""

    def __init__(self) -> None:
        self.messages: dict[str, list[str]] = {}

    def add(self, name: str, message: str) -> bool:
        """Add a message, and return whether to show it; `name` is that of its scan or
        job, or ""."""
        alike = self.messages.setdefault(_kind_of(name, message), [])
        if message in alike:
            return False
        alike.append(message)
        return len(alike) <= N_SHOWN

    def others(self) -> list[str]:
        """Return a line about the messages of each kind that were not shown."""
        hidden = [alike for alike in self.messages.values() if len(alike) > N_SHOWN]
        return [
            f"… and {len(alike) - N_SHOWN} more like: {alike[0]}" for alike in hidden
        ]


def grouped(messages: Iterable[tuple[str, str]]) -> list[tuple[str, int]]:
    """Return the lines that stand for messages, those of a kind together, and for how
    many each stands. A message has the name of its scan or ""."""
    kinds = Kinds()
    for name, message in messages:
        kinds.add(name, message)
    lines = []
    for alike in kinds.messages.values():
        lines += [(message, 1) for message in alike[:N_SHOWN]]
        count = len(alike) - N_SHOWN
        if count > 0:
            lines.append((f"… and {count} more like these", count))
    return lines


def counted(number: int, noun: str) -> str:
    """Return a number of things, such as "1 scan" or "2 scans"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _kind_of(name: str, message: str) -> str:
    return VARYING.sub(
        "#",
        message.replace(name, "#") if name else message,
    )
