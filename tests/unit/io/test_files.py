"""Files appear whole or not at all, and configurations are read strictly."""

import errno
import hashlib
import os

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from configurations import refusal
from facts import Facts
from shapes import sphere

from gyriflow.errors import InputError, StorageError
from gyriflow.io import files
from gyriflow.io.files import (
    atomic_write,
    contents,
    files_below,
    read_json,
    read_table,
    read_text_table,
    write_json,
    write_table,
)
from gyriflow.io.origins import joined_contents, origin_key, present_key
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import read_keys, read_yaml
from gyriflow.running.provenance import input_contents, recorded_inputs
from gyriflow.settings.base import folder_of, located
from gyriflow.study.loading import load


def test_a_file_appears_whole_and_stays_where_a_later_one_fails(tmp_path):
    path = tmp_path / "new" / "a.surf.gii"

    def write(text, ending):
        with atomic_write(path) as temporary:
            temporary.write_text(text)
            assert temporary.name.startswith(".")
            assert temporary.name.endswith(".surf.gii")
            if ending is not None:
                raise ending

    write("whole", None)
    with pytest.raises(KeyboardInterrupt):
        write("half", KeyboardInterrupt())
    assert path.read_text() == "whole"
    assert list(path.parent.iterdir()) == [path]


def test_full_disk_is_a_storage_error_that_names_the_file(tmp_path):
    path = tmp_path / "a.csv"
    facts = Facts(path, "No space left on device")
    with pytest.raises(StorageError, check=facts) as caught, atomic_write(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert caught.value.exit_code == 5


def test_json_unwraps_numpy_and_has_no_nan(tmp_path):
    path = tmp_path / "a.json"
    numbers = {"n": np.int64(3), "x": [np.float32(0.5), np.nan, np.inf]}
    write_json(path, numbers | {"m": np.eye(2), "ok": np.True_})
    assert read_json(path) == {
        "n": 3,
        "x": [0.5, None, None],
        "m": [[1.0, 0.0], [0.0, 1.0]],
        "ok": True,
    }


ROWS = [{"id": "s1", "age": "24,5"}, {"id": "s2", "age": "25"}]


@pytest.mark.parametrize(
    "content",
    [
        # tabs at the end of the rows that the heading does not have
        b"id\tage\ns1\t24,5\t\ns2\t25\t\n",
        # names of the rows without a heading, as R writes them
        b"id\tage\n1\ts1\t24,5\n2\ts2\t25\n",
        # as Excel saves tables
        b"sep=;\r\nid;age\r\ns1;24,5\r\ns2;25\r\n",
        "id\tage\ns1\t24,5\ns2\t25\n".encode("utf-16"),
        b"\xfe\xff" + "id\tage\r\ns1\t24,5\r\ns2\t25\r\n".encode("utf-16-be"),
        b'id,age\ns1,"24,5"\ns2,25\n',
    ],
)
def test_cells_of_tables_of_other_programs_stay_below_their_heading(tmp_path, content):
    (tmp_path / "participants.csv").write_bytes(content)
    assert read_text_table(tmp_path / "participants.csv") == ROWS


@pytest.mark.parametrize("start", [b"PK\x03\x04", b"\xd0\xcf\x11\xe0"])
def test_a_workbook_of_excel_is_named_with_what_to_do(tmp_path, start):
    (tmp_path / "participants.tsv").write_bytes(start + b"\x84\0\xff")
    with pytest.raises(InputError, check=Facts("participants.tsv:", "Excel", ".tsv")):
        read_text_table(tmp_path / "participants.tsv")


def test_folders_that_may_not_be_read_are_among_the_files(tmp_path, monkeypatch):
    for name in ("sub-01", "sub-02"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.nii").touch()
    scan = os.scandir

    def refused(path):
        if str(path).endswith("sub-02"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", refused)
    assert files_below(tmp_path) == [tmp_path / "sub-01" / "a.nii", tmp_path / "sub-02"]
    assert files_below(tmp_path / "lost") == []


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        # keys that are other values to YAML
        ("a:\n  021: {}\n", ["line 2", "021"]),
        ("a:\n  0x1F: {}\n", ["line 2", "0x1F"]),
        ("a:\n  true: {}\n", ["line 2", "true"]),
        ("a:\n  ~: {}\n", ["line 2", "~"]),
        # keys that are one
        ("a:\n  21.5: {}\n  21.50: {}\n", ["line 3", "21.5", "21.50"]),
        ("a:\n  b: {}\n  c: {}\n  b: {}\n", ["line 4", "b", "line 2"]),
        # numbers that are other ones to YAML
        ("a:\n- b: -017\n", ["line 2", "-017", -15]),
        ("a:\n- b: 23:4\n", ["line 2", "23:4", 1384]),
        ("a:\n- b: 1:30.5\n", ["line 2", "1:30.5", 90.5]),
        # what cannot be seen
        ("a:\n\t- b: 1\n", ["TAB"]),
        ("start:\u00a0a\nb: 1\n", ["NO-BREAK SPACE"]),
        ("a: 1\n\u200bb:2\nc: 3\n", ["ZERO WIDTH SPACE"]),
        # no keys
        ("a: [1\nb: 2\n", ["YAML", 2]),
        ("# a comment\n", ["`week: 21`"]),
        ("- a\n", ["list", "`week: 21`"]),
    ],
)
def test_what_yaml_reads_otherwise_than_written_is_refused(tmp_path, text, facts):
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, check=Facts(path, *facts)):
        read_keys(path)


def test_values_and_quoted_keys_are_read_as_written(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        'runs: {"021": {}, "true": {}, 1: {}, "1.0": {}, 21.50: {}}\n'
        "a: '023'\nb: [0, 0.5, -3, 1_000, 23.0, 1.0e+3]\n"
    )
    found = read_keys(path)
    assert list(found["runs"]) == ["021", "true", 1, "1.0", 21.5]
    assert (found["a"], found["b"]) == ("023", [0, 0.5, -3, 1000, 23.0, 1000.0])


def test_a_configuration_that_is_missing_or_of_another_encoding_says_so(tmp_path):
    path = tmp_path / "a.yaml"
    with pytest.raises(InputError, check=Facts(path, "No such file")):
        read_keys(path)
    path.write_bytes("# Müller\nstart: a\n".encode("latin-1"))
    with pytest.raises(InputError, check=Facts(path, "UTF-8", "0xfc")):
        read_keys(path)


@pytest.mark.parametrize("opening", ["[", "a: [", "{a: ", "- "])
def test_values_that_are_nested_deeply_are_refused(tmp_path, opening):
    """libyaml would end the process."""
    path = tmp_path / "study.yaml"
    path.write_text("a: [[1, {b: [2]}]]")
    assert read_yaml(path) == {"a": [[1, {"b": [2]}]]}
    path.write_text(opening * 100_000)
    with pytest.raises(InputError, check=Facts(path)):
        read_yaml(path)


def test_contents_are_read_again_only_where_size_or_times_changed(
    tmp_path, monkeypatch
):
    one, other, gone = tmp_path / "one", tmp_path / "other", tmp_path / "gone"
    one.write_text("a brain")
    other.write_text("another")
    first = contents([one, other, gone, tmp_path], {})
    assert list(first) == [str(one), str(other)]
    assert first[str(one)][0] == hashlib.sha256(b"a brain").hexdigest()
    # an older file of the same size takes its place
    state = one.stat()
    (tmp_path / "older").write_text("a train")
    os.utime(tmp_path / "older", ns=(state.st_atime_ns, state.st_mtime_ns))
    (tmp_path / "older").rename(one)
    read = []
    monkeypatch.setattr(files, "sha256_of", lambda path: read.append(path) or "new")
    second = contents([one, other], first)
    assert read == [str(one)]
    assert (second[str(one)][0], second[str(other)]) == ("new", first[str(other)])


@pytest.mark.parametrize(
    ("name", "behind", "text"),
    [
        ("a.hdr", "a.img", b""),
        ("a.img.gz", "a.hdr.gz", b""),
        (
            "a.surf.gii",
            "points & more.dat",
            b'<DataArray ExternalFileName="points &amp; more.dat" Dim0="3">',
        ),
    ],
)
def test_a_change_behind_an_input_is_one_of_its_contents(tmp_path, name, behind, text):
    (tmp_path / name).write_bytes(text)
    file = str(tmp_path / name)
    source = {"pial": file} if text else {"labels": file, "scheme": "binary"}
    found, config = [], load({"brains": [{"id": "a", "week": 21, **source}]})
    for content in ("one", "two"):
        (tmp_path / behind).write_text(content)
        found.append(input_contents(tmp_path, config, {}, record=True)[file])
    assert found[0] != found[1]
    recorded = joined_contents(recorded_inputs(tmp_path))
    assert recorded[file] == found[1]


LINK = ".git/annex/objects/aa/bb/K/K"
ABSENT = {
    LINK: "datalad get",
    "/annex/objects/K\n": "datalad get",
    "version https://git-lfs.github.com/spec/v1\n": "lfs",
}
READERS = {
    "a.nii.gz": read_label_volume,
    "a.img": lambda path: read_label_volume(path.with_suffix(".hdr")),
    "a.surf.gii": read_surface,
    "lh.pial": read_surface,
    "a.tsv": read_text_table,
    "a.json": read_json,
    "a.yaml": read_yaml,
}


@pytest.mark.parametrize("content", ABSENT, ids=["link", "pointer", "LFS"])
@pytest.mark.parametrize("name", READERS)
def test_content_that_is_not_here_is_named_with_the_command_that_gets_it(
    tmp_path, name, content
):
    nib.save(nib.Nifti1Pair(np.zeros((9, 9, 9), "u1"), np.eye(4)), tmp_path / "a.img")
    path = tmp_path / name
    path.unlink(missing_ok=True)
    path.symlink_to(content) if content is LINK else path.write_text(content)
    with pytest.raises(InputError, check=Facts(f"{path}:", ABSENT[content])):
        READERS[name](path)


def test_a_link_without_its_content_is_among_the_files_and_no_brain(tmp_path):
    path = tmp_path / "a.surf.gii"
    path.symlink_to(LINK)
    assert files_below(tmp_path) == [path]
    brain = {"id": "a", "week": 21, "pial": str(path)}
    assert refusal({"brains": [brain]}) == Facts(f"datalad get {path}")


def test_a_link_to_a_key_is_read_as_its_own_name_says(tmp_path):
    key = tmp_path / ".git" / "annex" / "objects" / "K" / "K"
    link = tmp_path / "a.surf.gii"
    write_surface(tmp_path / "b.surf.gii", sphere(10, 1))
    key.parent.mkdir(parents=True)
    (tmp_path / "b.surf.gii").rename(key)
    link.symlink_to(key)
    assert located(tmp_path, "a.surf.gii") == link
    assert len(read_surface(located(tmp_path, "a.surf.gii")).faces) == 80
    # a configuration too has its brains beside it, not in the store
    assert folder_of(link) == tmp_path


ORIGIN_TEXTS = {"a.hdr": "header", "a.img": "image", "b": "second"}


def origin(folder, weeks=(21, 22.5), **texts):
    """Return an origin that names two new files of a folder, the first with a
    companion."""
    folder.mkdir()
    for name, text in (ORIGIN_TEXTS | texts).items():
        (folder / name).write_text(text)
    files = [{"id": "a", "files": (str(folder / "a.hdr"),)}, str(folder / "b")]
    return {"weeks": weeks, "brains": files}


def test_a_key_is_of_the_contents_of_files_and_their_companions_not_of_their_paths(
    tmp_path,
):
    keys = [present_key(origin(tmp_path / name)) for name in ("first", "second")]
    for name in ORIGIN_TEXTS:
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


NAMES = ["021", "7", "1e5", "NA", "None", "true", "1.0", "2024-01-01", "-", "nan"]
TEXTS = ("subject", "run", "region", "observed", "start", "series", "page")


@pytest.mark.parametrize("names", [NAMES, *([name] * 2 for name in NAMES)])
def test_names_that_look_like_numbers_or_nothing_stay_texts(tmp_path, names):
    table = dict.fromkeys(TEXTS, names)
    table["week"] = [21.25 + number for number in range(len(names))]
    table["explained"] = [week % 2 > 1 for week in table["week"]]
    write_table(tmp_path / "a.csv", pd.DataFrame(table).assign(value=np.nan, unit=""))
    back = read_table(tmp_path / "a.csv")
    assert back[[*table]].to_dict("list") == table
    assert back[["value", "unit"]].isna().all(axis=None)
