"""Prints which rooms of the package import which others; the last line is a JSON object with rooms and arrows.

./run python benchmarks/import_graph.py

A room is a folder or a single module directly under `src/gyriflow`. `report -> geometry 6` says that 6 modules of
`report` import from `geometry`.
"""

import json
from collections import Counter

from gyriflow.provenance import PACKAGE, imported_modules, room_of


def arrows() -> Counter[tuple[str, str]]:
    """Returns the number of modules behind each arrow (importing room, imported room)."""
    pairs = {
        (source, room_of(source), room_of(module))
        for source in PACKAGE.rglob("*.py")
        for module in imported_modules(source)
    }
    return Counter((start, end) for _, start, end in pairs if start != end and "__init__" not in (start, end))


def main() -> None:
    counts = arrows()
    rooms = sorted({room_of(path) for path in PACKAGE.rglob("*.py")} - {"__init__"})
    for room in rooms:
        ends = ", ".join(f"{end} {counts[start, end]}" for start, end in sorted(counts) if start == room)
        print(f"{room} -> {ends or '-'}")
    print(json.dumps({"rooms": rooms, "arrows": {room: [b for a, b in sorted(counts) if a == room] for room in rooms}}))


if __name__ == "__main__":
    main()
