"""A Slurm of one machine in a private folder: munged, slurmctld and slurmd on ports of their own.

Nothing of the system's is read or changed. The node is declared with more processors than the machine may have, so
that two runs of two ranks fit on it side by side.
"""

import getpass
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "scancel", "scontrol", "squeue")
PATH = os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"])
MARK = "GYRIFLOW_SLURM_TRIAL"
NODE = "node1"
PROCESSORS = 4
CONF = f"""
ClusterName=trial
SlurmctldHost={{host}}(127.0.0.1)
SlurmctldPort={{ports[0]}}
SlurmdPort={{ports[1]}}
SlurmUser={{user}}
SlurmdUser={{user}}
AuthType=auth/munge
AuthInfo=socket={{folder}}/munge.socket,cred_expire=10
CredType=cred/munge
StateSaveLocation={{folder}}/state
SlurmdSpoolDir={{folder}}/spool
SlurmctldPidFile={{folder}}/slurmctld.pid
SlurmdPidFile={{folder}}/slurmd.pid
SlurmctldLogFile={{folder}}/slurmctld.log
SlurmdLogFile={{folder}}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SlurmdParameters=config_overrides
ReturnToService=1
KillWait=2
SlurmdTimeout=300
NodeName={NODE} NodeHostname={{host}} NodeAddr=127.0.0.1 CPUs={PROCESSORS} RealMemory=64000 State=UNKNOWN
PartitionName=all Nodes={NODE} Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> list[str]:
    """Returns the programs of Slurm and munge that this machine lacks."""
    return [program for program in PROGRAMS if shutil.which(program, path=PATH) is None]


@dataclass
class Cluster:
    """A running Slurm: its folder, and its processes by name."""

    folder: Path
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def environment(self) -> dict[str, str]:
        """Variables with which Slurm's commands find it, and one by which its jobs are known from those of others."""
        return {
            "SLURM_CONF": str(self.folder / "slurm.conf"),
            "PATH": os.pathsep.join([str(self.folder), PATH]),
            MARK: str(self.folder),
        }

    def start(self, name: str, *arguments: str) -> None:
        """Starts a daemon in the foreground of its own session."""
        with (self.folder / f"{name}.out").open("ab") as out:
            self.processes[name] = subprocess.Popen(
                [name, *arguments], env=os.environ | self.environment, start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=out, stderr=out,
            )  # fmt: skip

    def start_node(self) -> None:
        """Starts the daemon of the node."""
        self.start("slurmd", "-D", "-N", NODE)

    def ask(self, *command: str) -> str:
        """Returns what one of Slurm's commands prints."""
        done = subprocess.run(
            command, env=os.environ | self.environment, capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}{self.logs()}"
        return done.stdout

    def wait_for_node(self, *states: str, timeout_s: float = 60) -> None:
        """Waits until the node is in one of some states."""
        deadline = time.monotonic() + timeout_s
        while (state := self.ask("sinfo", "-h", "-n", NODE, "-o", "%T").strip()) not in states:
            assert time.monotonic() < deadline, f"the node is {state}\n{self.logs()}"
            time.sleep(0.5)

    def lose_node(self) -> None:
        """Kills the node's daemon and the programs of jobs, as a crash does, and tells Slurm that the node is down."""
        self.processes["slurmd"].kill()
        self.processes.pop("slurmd").wait()
        self.kill_steps()
        self.ask("scontrol", "update", f"nodename={NODE}", "state=down", "reason=crash")

    def kill_steps(self) -> None:
        """Kills what Slurm has started for jobs: its step daemons and all below or beside them."""
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                environment = process.environ()
                of_a_job = process.name() == "slurmstepd" or "SLURM_JOB_ID" in environment
                if of_a_job and environment.get(MARK) == str(self.folder):
                    process.kill()

    def return_node(self) -> None:
        """Starts the node again after a crash."""
        self.start_node()
        time.sleep(1)
        self.ask("scontrol", "update", f"nodename={NODE}", "state=resume")
        self.wait_for_node("idle", "mixed", "allocated")

    def logs(self) -> str:
        """Returns the ends of the daemons' logs."""
        files = [*self.folder.glob("*.log"), *self.folder.glob("*.out")]
        return "\n".join(f"--- {file.name}\n{file.read_text(errors='replace')[-1500:]}" for file in files)

    def stop(self) -> None:
        """Ends all jobs and daemons."""
        with suppress(subprocess.SubprocessError, OSError):
            subprocess.run(
                ["scancel", "--user", getpass.getuser()],
                env=os.environ | self.environment, capture_output=True, timeout=10, check=False,
            )  # fmt: skip
        for name in ("slurmd", "slurmctld", "munged"):
            if process := self.processes.pop(name, None):
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(timeout=10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        self.kill_steps()


def free_ports(number: int) -> list[int]:
    """Returns ports that nobody listens on."""
    sockets = [socket.socket() for _ in range(number)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    """A Slurm in a folder, which is stopped at the end however that comes."""
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o400)
    conf = CONF.format(host=socket.gethostname(), user=getpass.getuser(), folder=folder, ports=free_ports(2))
    (folder / "slurm.conf").write_text(conf)
    (folder / "cgroup.conf").write_text("CgroupPlugin=disabled\n")
    # the executor keeps variables of Slurm's from jobs, also that of a configuration in an unusual place
    srun = folder / "srun"
    srun.write_text(f'#!/bin/sh\nSLURM_CONF={folder}/slurm.conf exec {shutil.which("srun", path=PATH)} "$@"\n')
    srun.chmod(0o700)
    running = Cluster(folder)
    try:
        munge = {name: folder / f"munge.{name}" for name in ("socket", "pid", "log", "seed")}
        running.start(
            "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={munge['socket']}",
            f"--pid-file={munge['pid']}", f"--log-file={munge['log']}", f"--seed-file={munge['seed']}",
        )  # fmt: skip
        deadline = time.monotonic() + 20
        while not munge["socket"].exists():
            assert time.monotonic() < deadline, running.logs()
            time.sleep(0.1)
        running.start("slurmctld", "-D")
        running.start_node()
        deadline = time.monotonic() + 60
        while subprocess.run(["sinfo"], env=os.environ | running.environment, capture_output=True).returncode:
            assert time.monotonic() < deadline, running.logs()
            time.sleep(0.5)
        running.wait_for_node("idle")
        yield running
    finally:
        running.stop()
