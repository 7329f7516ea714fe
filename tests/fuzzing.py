"""Random damage to files, for tests that try what readers do with it; the same damage
at each run."""

from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from gyriflow.errors import GyriflowError

# drawn from a fixed seed; the machine's speed does not decide
BOUNDED = settings(
    max_examples=10,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

# what numbers and words in headers are likely to be mistaken for
WORDS = [*b"-1 999999999999 nan inf 1e400".split(), b"\n", *b'< > & "'.split()]
NUMBERS = "00000000 ffffffff 7fffffff ffffff7f 0000c07f 0000807f"
ODD_BYTES = st.one_of(
    st.binary(min_size=1, max_size=8),
    st.sampled_from([bytes.fromhex(number) for number in NUMBERS.split()]),
    st.sampled_from([*WORDS, b"\t", b": ", b"[", b"{"]),
)


@st.composite
def damaged(draw: st.DrawFn, whole: bytes, header: int | None = None) -> bytes:
    """Draw a damaged copy of a file's bytes: cut, overwritten, lengthened, or with a
    part missing or twice.

    `header` is the length of what decides how the rest is read; half of the damage
    falls there.
    """
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        ends = [len(data)] if header is None else [len(data), min(header, len(data))]
        start = draw(st.integers(0, max(draw(st.sampled_from(ends)) - 1, 0)))
        kind = draw(
            st.sampled_from(
                ["cut", "overwrite", "overwrite", "insert", "drop", "repeat"]
            )
        )
        length = draw(st.integers(1, 64))
        if kind == "cut":
            del data[start:]
        elif kind == "drop":
            del data[start : start + length]
        elif kind == "repeat":
            data[start:start] = data[start : start + length]
        else:
            odd = draw(ODD_BYTES)
            data[start : start + (len(odd) if kind == "overwrite" else 0)] = odd
    return bytes(data)


def outcome(read, *arguments):
    """Return what a reader gives, or None where it refuses with a message of gyriflow;
    any other error gets out.

    A reader leaves the folder of its file as it was.
    """
    folder = Path(arguments[0]).parent
    before = {path: path.stat().st_size for path in folder.iterdir()}
    refusal = None
    try:
        return read(*arguments)
    except GyriflowError as error:
        refusal = error
        return None
    finally:
        if refusal is not None:
            assert refusal.exit_code == 2
            assert str(folder) in str(refusal), f"the message names no file: {refusal}"
        assert {path: path.stat().st_size for path in folder.iterdir()} == before
