"""Keys of what a file was made from: by the contents of the files that are named, not
by their paths."""

from gyriflow.io.files import contents
from gyriflow.io.origins import joined_contents, origin_key, present_key


def origin(folder):
    """Return a description that names two files of a folder, one of them with a
    companion."""
    return {
        "weeks": [21, 22.5],
        "brains": [{"id": "a", "files": (str(folder / "a.hdr"),)}, str(folder / "b")],
    }


def written(folder, **texts):
    """Write the files of an origin into a new folder, and return it."""
    folder.mkdir()
    for name, text in {
        "a.hdr": "header",
        "a.img": "image",
        "b": "second",
        **texts,
    }.items():
        (folder / name).write_text(text)
    return folder


def test_a_key_is_of_the_contents_of_files_and_their_companions_not_of_their_paths(
    tmp_path,
):
    one = origin(written(tmp_path / "one"))
    key = present_key(one)
    assert key == present_key(origin(written(tmp_path / "two")))
    changes = [{"a.hdr": "other"}, {"a.img": "other"}, {"b": "other"}]
    changed = [
        present_key(origin(written(tmp_path / f"changed {n}", **texts)))
        for n, texts in enumerate(changes)
    ]
    changed.append(present_key(one | {"weeks": [21, 23]}))
    assert len({key, *changed}) == 5


def test_a_key_is_the_same_from_contents_that_are_known_already(tmp_path):
    folder = written(tmp_path / "one")
    found = contents([folder / "a.hdr", folder / "b"], {})
    assert origin_key(origin(folder), joined_contents(found)) == present_key(
        origin(folder)
    )


def test_there_is_no_key_where_a_file_is_missing(tmp_path):
    folder = written(tmp_path / "one")
    (folder / "b").unlink()
    assert present_key(origin(folder)) is None
