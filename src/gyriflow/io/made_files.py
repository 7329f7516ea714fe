"""Files that gyriflow makes in a folder that may contain files of a user or another
program, too."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import InputError
from .files import AnyPath, files_below, read_json, write_json


@contextmanager
def making_files(
    folder: AnyPath,
    record: AnyPath,
    *subfolders: str,
) -> Iterator[None]:
    """Remove the files that earlier blocks made in a folder, and list those that this
    block makes in `record`.

    With `subfolders`, only earlier files in these are removed. Files that are not
    listed are left.
    """
    folder, listed = Path(folder), set[str]()
    with suppress(InputError):
        listed = set(read_json(record))
    removed = {
        name
        for name in listed
        if not subfolders or name.partition("/")[0] in subfolders
    }
    for name in removed:
        (folder / name).unlink(missing_ok=True)
        for parent in Path(name).parents:
            with suppress(OSError):  # of a folder with other files, or that is gone
                (folder / parent).rmdir()
    others = set(files_below(folder))
    try:
        yield
    finally:
        made = {
            path.relative_to(folder).as_posix()
            for path in files_below(folder)
            if path not in others
        }
        write_json(record, sorted(listed - removed | made))


def require_own_data_set(folder: Path) -> None:
    """Raise InputError if a folder is a data set that gyriflow has not made, whose
    files are not replaced."""
    path = folder / "dataset_description.json"
    if path.is_file() and not is_own_data_set(path):
        raise InputError(
            "belongs to a data set that gyriflow has not made",
            path=path,
            remedy="Choose another OUT, such as a new folder in derivatives/.",
        )


def is_own_data_set(description: Path) -> bool:
    """Return whether a file dataset_description.json is gyriflow's."""
    try:
        content = read_json(description)
    except InputError:
        return False
    tools = content.get("GeneratedBy") if isinstance(content, dict) else None
    return any(
        isinstance(tool, dict) and tool.get("Name") == "gyriflow"
        for tool in tools or ()
    )
