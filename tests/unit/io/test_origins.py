"""Keys of what a file was made from: by the contents of the files that are named, not
by their paths."""

from gyriflow.io.files import contents
from gyriflow.io.origins import joined_contents, origin_key, present_key

TEXTS = {"a.hdr": "header", "a.img": "image", "b": "second"}


def origin(folder, weeks=(21, 22.5), **texts):
    """Return an origin that names two new files of a folder, the first with a
    companion."""
    folder.mkdir()
    for name, text in (TEXTS | texts).items():
        (folder / name).write_text(text)
    files = [{"id": "a", "files": (str(folder / "a.hdr"),)}, str(folder / "b")]
    return {"weeks": weeks, "brains": files}


def test_a_key_is_of_the_contents_of_files_and_their_companions_not_of_their_paths(
    tmp_path,
):
    keys = [present_key(origin(tmp_path / name)) for name in ("first", "second")]
    for name in TEXTS:
        changed = origin(tmp_path / f"changed {name}", **{name: "other"})
        keys.append(present_key(changed))
    keys.append(present_key(origin(tmp_path / "changed weeks", (21, 23))))
    assert keys[0] == keys[1]
    assert len(set(keys)) == 5


def test_a_key_is_the_same_from_contents_that_are_known_already(tmp_path):
    folder = tmp_path / "known"
    described = origin(folder)
    known = joined_contents(contents([folder / "a.hdr", folder / "b"], {}))
    assert origin_key(described, known) == present_key(described)
    (folder / "b").unlink()
    assert present_key(described) is None
