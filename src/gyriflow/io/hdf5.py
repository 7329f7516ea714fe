"""HDF5 files that appear whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager

import h5py

from .files import AnyPath, replaced


@contextmanager
def new_hdf5(path: AnyPath) -> Iterator[h5py.File]:
    """Yields an HDF5 file to be filled, which takes its place when the block ends well; StorageError where it can't."""
    with replaced(path) as temporary:
        # in memory first: HDF5 crashes later on where a write of its own has failed, as on a full disk
        with h5py.File(temporary.name, "w", driver="core", backing_store=False) as file:
            yield file
            file.flush()
            image = file.id.get_file_image()
        temporary.write_bytes(image)
