"""Folders of scans as labs have them, made from a few words: paths with their
contents."""

import json
import os
from functools import cache
from pathlib import Path
from typing import Any

from shapes import phantom, save_labels

from gyriflow.io.volumes import LabelVolume

ANNEX = ".git/annex/objects/aa/bb/KEY/KEY"


@cache
def labels(scale: float = 1.0) -> LabelVolume:
    return LabelVolume(*phantom(24.0 * scale, 2.0))


def make_tree(folder: Path, **contents: Any) -> Path:
    """Write the files of `contents` into a folder, by path, and return it.

    A list of paths under `labels`, `surfaces` and `lost` has label volumes, FreeSurfer
    surfaces' first bytes and links into a git-annex without their contents; `tables`
    has rows by path, of words that are separated by spaces; `json` has contents by
    path; `text` has texts.
    """
    for path in contents.get("labels", ()):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        save_labels(folder / path, labels().labels, labels().affine)
    for path in contents.get("surfaces", ()):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"\xff\xff\xfe")
    for path in contents.get("lost", ()):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).symlink_to(
            os.path.relpath(folder / ANNEX, (folder / path).parent)
        )
    texts = {
        path: "\n".join("\t".join(row.split(" ")) for row in rows)
        for path, rows in contents.get("tables", {}).items()
    }
    texts |= {
        path: json.dumps(content) for path, content in contents.get("json", {}).items()
    }
    for path, text in (texts | contents.get("text", {})).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text + "\n")
    return folder
