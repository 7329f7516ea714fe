r"""Where code is compiled, and for which processors.

The tests of our C code under the address and undefined-behaviour sanitizers of gcc:

    ./run env XDG_CACHE_HOME=/tmp/sanitized PYTHONMALLOC=malloc \
        ASAN_OPTIONS=detect_leaks=0 \
        LD_PRELOAD="$(./run gcc -print-file-name=libasan.so) \
            $(./run gcc -print-file-name=libubsan.so)" python -c \
    'import sys, pytest; from gyriflow.folding import compilation; (
        compilation.COMPILER_ARGUMENTS.extend(["-g", "-fsanitize=address,undefined"]),
        sys.exit(pytest.main(["-q", "-n", "0", "-m", "not slow", *sys.argv[1:]])),
    )' tests/mpi/linear_elements_cases.py tests/mpi/linear_solver_cases.py \
        tests/unit/folding/test_compilation.py
"""

from types import SimpleNamespace

import cffi
import numpy as np
import pytest
from facts import Facts

from gyriflow.folding.compilation import form_compiler, pointer
from gyriflow.folding.products import PartMotions, multiply_blocks


def test_ranks_on_different_processors_share_code_that_all_can_execute(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folders = {}
    for processors in (("old", "old"), ("new",), ("old", "new"), ("new", "old")):
        ranks = SimpleNamespace(
            rank=0, allgather=lambda _, found=processors: found, barrier=lambda: None
        )
        with form_compiler(ranks) as options:
            folders[processors] = options["cache_dir"]
            assert ("-march=native" in options["cffi_extra_compile_args"]) == (
                len(set(processors)) == 1
            )
    assert folders["old", "new"] == folders["new", "old"]
    assert len(set(folders.values())) == 3


def test_c_code_gets_arrays_of_its_type_and_size_only():
    interface = cffi.FFI()
    numbers = np.arange(6.0).reshape(2, 3)
    assert (
        interface.cast("double *", pointer(interface, numbers, np.float64, 6))[4] == 4.0
    )
    for wrong in (
        numbers.astype(np.float32),
        numbers.astype(np.int64),
        numbers.astype(">f8"),
    ):
        with pytest.raises(TypeError, check=Facts("float64", str(wrong.dtype))):
            pointer(interface, wrong, np.float64, 6)
    with pytest.raises(ValueError, check=Facts(7, "(2, 3)")):
        pointer(interface, numbers, np.float64, 7)
    with pytest.raises(ValueError, match="contiguous"):
        pointer(interface, numbers.T, np.float64, 6)
    fixed = numbers.copy()
    fixed.setflags(write=False)
    pointer(interface, fixed, np.float64, 6)
    with pytest.raises(ValueError, match="read-only"):
        pointer(interface, fixed, np.float64, 6, is_written=True)


def test_products_refuse_arrays_that_c_code_would_misread():
    blocks, x, y = np.ones((4, 3, 3), np.float32), np.ones(12), np.zeros(12)
    multiply_blocks(blocks, x, y)
    assert y == pytest.approx(3.0)
    for wrong in (
        (blocks.astype(float), x, y),
        (blocks, x.astype(np.float32), y),
        (blocks, x, y.astype(int)),
    ):
        with pytest.raises(TypeError):
            multiply_blocks(*wrong)
    for short in ((blocks, x[:9], y), (blocks, x, y[:9])):
        with pytest.raises(ValueError, check=Facts(12, "(9,)")):
            multiply_blocks(*short)

    motions = PartMotions(np.array([0, 0, 1, 1]), np.ones((4, 3), np.float32))
    assert motions.restrict(x, 2)[:3] == pytest.approx(2.0)
    with pytest.raises(TypeError):
        motions.restrict(x.astype(np.float32), 2)
    with pytest.raises(ValueError, check=Facts(12, "(9,)")):
        motions.add(np.zeros(12), y[:9])
    with pytest.raises(TypeError):
        PartMotions(np.array([0, 0, 1, 1]), np.ones((4, 3))).restrict(x, 2)
