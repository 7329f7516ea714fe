"""What a file of frames holds beyond what the package reads itself."""

import h5py

from gyriflow.io.frames import CELL_FIELDS, group_name


def element_field(path, week, field):
    """Return a field of the elements, (m,) or more, at a week."""
    with h5py.File(path) as file:
        return file[f"{group_name(week)}/{CELL_FIELDS}/{field}"][:]
