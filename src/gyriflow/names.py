"""Names that become one: in folders, labels and columns, where two things must not
share a name."""

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator

from .errors import InputError

DEVICE = re.compile(r"(con|prn|aux|nul|com[1-9]|lpt[1-9])(\..*)?", re.IGNORECASE)
"""Names that Windows takes for devices, so that its disks have no folders of them."""


def merged_names(
    names: Iterable[str], become: Callable[[str], str]
) -> Iterator[tuple[str, str]]:
    """Yield each name that becomes the same as an earlier, different name, after that
    one."""
    earlier: dict[str, str] = {}
    for name in names:
        first = earlier.setdefault(become(name), name)
        if first != name:
            yield first, name


def folder_name(name: str) -> str:
    """Return a name as disks see it that ignore case, dots and spaces at its end, and
    which of several forms of a letter with accents it has."""
    return unicodedata.normalize("NFC", name).casefold().rstrip(". ")


def column_part(name: str) -> str:
    """Return a name as it stands in the names of columns, with hyphens in place of
    spaces."""
    return name.replace(" ", "-")


def bids_label(name: str) -> str:
    """Return the ASCII letters and digits of a name, of which labels of BIDS
    consist."""
    return "".join(letter for letter in name if letter.isascii() and letter.isalnum())


def bids_subject(name: str) -> str:
    """Return the BIDS label of a subject, with `sub-`."""
    return f"sub-{bids_label(name.removeprefix('sub-'))}"


def require_bids_names(subjects: Iterable[str], runs: Iterable[str] = ()) -> None:
    """Raise InputError where a subject or a run has no BIDS label, or two have the same
    one, with both names."""
    _require_labels("subject", subjects, bids_subject)
    _require_labels("run", runs, bids_label)


def _require_labels(
    kind: str,
    names: Iterable[str],
    label: Callable[[str], str],
) -> None:
    names = list(names)
    for name in names:
        if label(name) == label(""):
            raise InputError(
                f"a {kind} has no BIDS label", found=name, expected="letters or digits"
            )
    for first, second in merged_names(
        names,
        lambda name: folder_name(label(name)),
    ):
        raise InputError(
            f"two {kind}s have the same BIDS label, {label(first)}",
            found=f"{first} and {second}",
            expected=f"{kind}s that differ in their letters and digits",
            remedy="Rename one of them.",
        )
