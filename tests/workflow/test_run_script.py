"""./run itself: what it executes, what it hands on, and that its set-up can be interrupted. No environment is made."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from facts import Facts
from processes import command_of, ran

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUN = ROOT / "run"

CONDA = r"""#!/bin/bash
# stands in for conda or micromamba: notes its arguments, makes an environment that holds one program
echo "$*" >> "$RECORD"
case "$*" in
    *hook*)
        name=$(basename "$0")
        echo "$name() { export CONDA_PREFIX=\$2; export PATH=\$2/bin:\$PATH; }" ;;
    *create*)
        if [ -e "$RECORD.fails" ]; then echo "PackagesNotFoundError: no such thing"; exit 1; fi
        while [ "$1" != -p ]; do shift; done
        if [ -e "$2/half" ]; then echo "something was left behind"; exit 1; fi
        mkdir -p "$2/bin"
        touch "$2/half"
        sleep "${SECONDS_TO_CREATE:-0}"
        while [ -e "$RECORD.wait" ]; do sleep 0.05; done
        rm "$2/half"
        printf '#!/bin/sh\necho "from the environment: $*"\n' > "$2/bin/tool"
        chmod +x "$2/bin/tool" ;;
esac
"""

MOUNT = f"""#!{sys.executable}
# the tree has no mount
import ctypes, sys
libc = ctypes.CDLL(None, use_errno=True)
*how, source, place = sys.argv[1:]
kind, flags, data = None, 0, None
if how[0] in ("--bind", "--rbind"):
    flags = 4096 | (16384 if how[0] == "--rbind" else 0)
else:
    kind = how[1].encode()
    data = how[3].encode() if len(how) > 2 else None
sys.exit(libc.mount(source.encode(), place.encode(), kind, flags, data) and ctypes.get_errno())
"""


@pytest.fixture
def outside(tmp_path):
    """Return the variables of a shell outside of any environment, with a stand-in for conda first on PATH."""
    programs = tmp_path / "programs"
    programs.mkdir()
    conda = programs / "conda"
    conda.write_text(CONDA)
    conda.chmod(0o755)
    env = {name: value for name, value in os.environ.items() if name not in {"VIRTUAL_ENV", "CONDA_PREFIX"}}
    files = {"GYRIFLOW_CACHE": str(tmp_path / "cache"), "RECORD": str(tmp_path / "record")}
    return env | files | {"PATH": f"{programs}:{env['PATH']}"}


OWN = f"9{os.getpid()}.25"
"""Seconds to sleep by which the processes of these tests are told from all others."""


def run(*command, env=None):
    return ran(RUN, *command, env=env, timeout_s=60)


def start(*command, env):
    """Start ./run with signals as a shell starts it, whatever they are here."""
    return subprocess.Popen(
        [RUN, *command], env=env,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: [signal.signal(s, signal.SIG_DFL) for s in (signal.SIGINT, signal.SIGTERM)],
    )  # fmt: skip


def wait_until(condition, seconds=20.0):
    """Return whether a condition came true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def running(word):
    """Return the processes that have a word in their command line."""
    pids = [int(process.name) for process in Path("/proc").glob("[0-9]*")]
    return [pid for pid in pids if pid != os.getpid() and any(word in part for part in command_of(pid))]


# --- inside an environment -----------------------------------------------------------------------------------


def test_arguments_and_exit_code_are_handed_on():
    assert run("printf", "%s|", "a b", "", "*", "$HOME", "'").stdout == "a b||*|$HOME|'|"
    assert run("bash", "-c", "exit 7").returncode == 7
    assert run("no-such-command").returncode == 127


def test_blas_is_an_optimised_one():
    loaded = run("python", "-c", "import petsc4py.PETSc; print(open('/proc/self/maps').read())").stdout
    assert "openblas" in loaded or "mkl" in loaded


# --- conda ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "create", "hook"),
    [("conda", "env create", "shell.bash hook"), ("micromamba", "create --yes", "shell hook --shell bash")],
)
def test_conda_environment_is_made_once_and_activated(outside, tmp_path, name, create, hook):
    (tmp_path / "programs" / "conda").rename(tmp_path / "programs" / name)
    tag = hashlib.sha256((ROOT / "envs" / "gyriflow.yaml").read_bytes()).hexdigest()[:12]
    prefix = tmp_path / "cache" / f"conda-{tag}" / "conda"
    first = run("tool", "1", env=outside)
    second = run("bash", "-c", "tool 2; exit 5", env=outside)
    assert (first.stdout, first.returncode) == ("from the environment: 1\n", 0)
    assert (second.stdout, second.returncode) == ("from the environment: 2\n", 5)
    assert first.stderr == Facts(prefix.parent)
    assert second.stderr == ""

    made = f"{create} -p {prefix} -f {ROOT}/envs/gyriflow.yaml"
    assert (tmp_path / "record").read_text().splitlines() == [made, hook, hook]


def test_an_empty_home_is_that_of_the_user_not_the_root_of_the_system(outside, tmp_path):
    (tmp_path / "programs" / "getent").write_text(f"#!/bin/sh\necho me:x:0:0::{tmp_path}/home:/bin/sh\n")
    (tmp_path / "programs" / "getent").chmod(0o755)
    env = {name: value for name, value in outside.items() if name not in ("GYRIFLOW_CACHE", "XDG_CACHE_HOME")}
    assert run("tool", "1", env=env | {"HOME": ""}).stdout == "from the environment: 1\n"
    assert list((tmp_path / "home" / ".cache" / "gyriflow").glob("conda-*/ready"))


def test_no_module_of_the_working_directory_is_imported(outside, tmp_path):
    (tmp_path / "dolfinx.py").write_text("open('foreign.ran', 'w')")
    command = ["bash", "-c", f"cd '{tmp_path}' && '{RUN}' true"]
    assert ran(*command, env=outside | {"VIRTUAL_ENV": "x"}).returncode == 0
    assert not (tmp_path / "foreign.ran").exists()


def test_signals_reach_a_command_in_conda(outside):
    process = start("bash", "-c", "trap 'echo stopped; exit 9' TERM; echo up; while :; do sleep 0.1; done", env=outside)
    assert process.stdout.readline() == "up\n"
    process.send_signal(signal.SIGTERM)
    assert process.stdout.read() == "stopped\n"
    assert process.wait(20) == 9


def test_failing_set_up_shows_why_and_is_tried_again(outside, tmp_path):
    fails = tmp_path / "record.fails"
    fails.touch()
    done = run("tool", env=outside)
    assert done.returncode == 2
    assert done.stderr == Facts("create_conda", "PackagesNotFoundError: no such thing")
    assert done.stdout == ""
    fails.unlink()
    assert run("tool", "now", env=outside).stdout == "from the environment: now\n"


def test_two_at_once_make_one_environment(outside, tmp_path):
    held = tmp_path / "record.wait"
    held.touch()
    first = start("tool", "first", env=outside)
    assert wait_until((tmp_path / "record").exists)
    second = start("tool", "second", env=outside)
    waiting = second.stderr.readline()
    held.unlink()
    results = [process.communicate(timeout=30) for process in (first, second)]
    assert [out for out, _ in results] == ["from the environment: first\n", "from the environment: second\n"]
    assert waiting == Facts("gyriflow:", "./run")
    assert sum("create" in line for line in (tmp_path / "record").read_text().splitlines()) == 1


@pytest.mark.fault(74)
def test_an_environment_is_made_without_locks(outside, tmp_path):
    (tmp_path / "programs" / "flock").write_text("#!/bin/sh\nexit 71\n")
    (tmp_path / "programs" / "flock").chmod(0o755)
    done = run("tool", "1", env=outside)
    assert done.stdout == "from the environment: 1\n"
    assert done.stderr == Facts(f"{tmp_path / 'cache'} has no locks")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_interrupted_set_up_leaves_nothing_running_and_is_redone(outside, tmp_path, number, code):
    process = start("tool", "first", env=outside | {"SECONDS_TO_CREATE": OWN})
    assert wait_until(lambda: running(OWN))
    process.send_signal(number)
    assert process.wait(20) == code
    if number != signal.SIGKILL:
        assert process.stderr.read() == Facts("gyriflow:")
        assert not running(OWN)
    # after SIGKILL the stand-in is gone, yet not what it had started: the next run waits for that
    for orphan in running(OWN):
        os.kill(orphan, signal.SIGTERM)
    assert run("tool", "again", env=outside).stdout == "from the environment: again\n"


# --- the Debian tree, entered once more by chroot from inside itself -------------------------------------------


@pytest.fixture
def tree(outside, tmp_path):
    """Return the variables of a shell in which ./run has to enter the Debian tree that the tests run in."""
    venv = Path(os.environ.get("VIRTUAL_ENV", "/nowhere"))
    (recipe,) = re.findall(r"^recipe=(\d+)", RUN.read_text(), flags=re.MULTILINE)
    lists = [(ROOT / "envs" / name).read_bytes() for name in ("debian.txt", "requirements.txt")]
    tag = hashlib.sha256(b"".join(lists) + f"{recipe}\n".encode()).hexdigest()[:12]
    if venv.parent.name != f"debian-{tag}" or os.getuid() != 0:
        pytest.skip("not in the Debian tree of this checkout, or not root")
    programs = tmp_path / "programs"
    (programs / "conda").unlink()
    no_rights = "#!/bin/sh\necho 'bwrap: no rights here' >&2; exit 1\n"
    stand_ins = {"apt-cache": "#!/bin/sh\n# knows no dolfinx\n", "bwrap": no_rights, "mount": MOUNT}
    for name, text in stand_ins.items():
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    env = outside | {"GYRIFLOW_CACHE": str(venv.parents[1]), "PATH": f"{programs}:/usr/bin:/bin:/usr/sbin"}
    probe = run("true", env=env)
    if probe.returncode:
        pytest.skip(f"a chroot cannot be entered here: {probe.stderr}")
    return env


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_tree_leaves_nothing_behind(tree, number):
    process = start("bash", "-c", f"sleep {OWN} & echo up; wait", env=tree)
    assert process.stdout.readline() == "up\n"
    process.send_signal(number)
    assert process.wait(20) == (-9 if number == signal.SIGKILL else 128 + number)
    assert wait_until(lambda: not running(OWN))


def test_two_mpi_runs_in_trees_do_not_meet(tree):
    # both have the same process ids, by which Open MPI names its files
    code = (
        "from mpi4py import MPI; import time\n"
        "for _ in range(20): MPI.COMM_WORLD.allreduce(1); time.sleep(0.05)\n"
        "MPI.COMM_WORLD.rank or print(MPI.COMM_WORLD.allreduce(1) if MPI.COMM_WORLD.size == 1 else 'done')"
    )
    both = [start("mpiexec", "-n", "2", "python", "-c", code, env=tree) for _ in range(2)]
    for process in both:
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (0, "done\n"), err
