"""Names that become one: in folders, labels and columns, where two things must not share a name."""

from collections.abc import Callable, Iterable, Iterator


def merged_names(names: Iterable[str], become: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    """Yield each name that becomes the same as an earlier, different name, after that one."""
    earlier: dict[str, str] = {}
    for name in names:
        first = earlier.setdefault(become(name), name)
        if first != name:
            yield first, name


def folder_name(name: str) -> str:
    """Return a name as disks that ignore case see it."""
    return name.casefold()


def column_part(name: str) -> str:
    """Return a name as it stands in the names of columns, with hyphens in place of spaces."""
    return name.replace(" ", "-")


def bids_label(name: str) -> str:
    """Return the ASCII letters and digits of a name, of which labels of BIDS consist."""
    return "".join(letter for letter in name if letter.isascii() and letter.isalnum())


def bids_subject(name: str) -> str:
    """Return the BIDS label of a subject, with `sub-`."""
    return f"sub-{bids_label(name.removeprefix('sub-'))}"
