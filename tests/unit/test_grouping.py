"""Messages of one kind are shown three times and then counted."""

import pytest
from facts import Facts

from gyriflow.grouping import N_SHOWN, Kinds, grouped

AGE = (
    "{0}: age: has no unit; expected Units in participants.json (participants.tsv row"
    " {1})"
)


def test_a_hundred_scans_with_one_fault_are_three_lines_and_a_number():
    scans = [f"sub-{number:03}" for number in range(100)]
    messages = [
        (scan, AGE.format(scan, row)) for row, scan in enumerate(scans, start=2)
    ]
    messages.insert(50, ("anna", "anna: is empty"))
    lines = grouped(messages)
    assert lines[:3] == [
        (AGE.format(scan, row), 1) for row, scan in enumerate(scans[:3], start=2)
    ]
    assert lines[3] == (Facts(97), 97)
    assert lines[4:] == [("anna: is empty", 1)]


@pytest.mark.parametrize(
    "names", [["anna", "ben", "carla", "dora"], ["1", "2", "3", "4"]]
)
def test_messages_are_of_one_kind_whatever_the_names_numbers_and_paths(names):
    kinds = Kinds()
    shown = [
        kinds.add(name, f"{name}: /a/{name}.gii: {len(name)}.5 mm is too thin")
        for name in names
    ]
    assert shown == [True] * N_SHOWN + [False]
    # another one, and one that comes again
    assert kinds.add("eve", "eve: /a/eve.gii: 3 mm is too thick")
    assert not kinds.add("eve", "eve: /a/eve.gii: 3 mm is too thick")
    assert kinds.others() == [Facts("1 more like: ", f"/a/{names[0]}.gii")]
