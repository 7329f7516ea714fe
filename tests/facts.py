"""What a message has to give, in whatever words: paths, keys, names and numbers."""

import re


class Facts:
    """Equal to each text that gives all these facts as whole names and numbers; as a
    check, it passes such errors.

    A key or a file is not found in a longer one, nor 5 in 2.5; 24 is found in 24.00.
    """

    def __init__(self, *facts: object) -> None:
        self.facts = facts

    def __eq__(self, message: object) -> bool:
        return all(re.search(pattern(fact), str(message)) for fact in self.facts)

    def __call__(self, error: Exception) -> bool:
        if self != error:
            raise AssertionError(f"{self} are not all in: {error}")
        return True

    def __repr__(self) -> str:
        return f"Facts{self.facts}"


def pattern(fact: object) -> str:
    """Return what finds a fact in a text, and nothing longer."""
    text = f"{fact:.10g}" if isinstance(fact, float) else str(fact)
    starts = r"(?<!\w)(?<!\w\.)" if re.match(r"\w", text) else ""
    ends = r"(?!\w)(?!\.\w)(?!\[)" if re.search(r"\w$", text) else ""
    if isinstance(fact, int | float) and not isinstance(fact, bool):
        # a minus is of the number; 21-24 is a range
        starts = rf"{starts}(?<!\W-)"
        ends = ("0*" if "." in text else r"(?:\.0+)?") + ends
    return starts + re.escape(text) + ends
