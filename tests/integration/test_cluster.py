"""The one way to a Dask cluster: who answers, who flies, what is lost, what is encrypted; each fault in a sentence."""

from __future__ import annotations

import functools
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

import pytest
from distributed import LocalCluster, Security, get_worker

from rtsim.aircraft import profile
from rtsim.cli.cluster import cluster_of
from rtsim.cli.main import run
from rtsim.cluster import identity as identity_module
from rtsim.cluster.identity import identity
from rtsim.cluster.work import Cluster
from rtsim.errors import EXIT_BAD_INPUT, EXIT_OUTPUT_FAILED, InputError, OutputError
from rtsim.loop.options import FlightOptions
from scenarios.campaign.chunks import LawVariant, Task, task_identity
from tests.certificates import Authority

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
GOES_ON = "the same command goes on"


@contextmanager
def workers(count, **options):
    """Workers that are threads of this process."""
    options = {"protocol": "tcp", "host": "127.0.0.1"} | options
    with LocalCluster(
        n_workers=count, threads_per_worker=1, processes=False, dashboard_address=":0", **options
    ) as made:
        yield made


@pytest.fixture(scope="module")
def one():
    with workers(1) as made:
        yield made


@pytest.fixture
def hurried(monkeypatch):
    monkeypatch.setattr("rtsim.cluster.work.WORKERS_WAIT_S", 0.5)
    monkeypatch.setattr("rtsim.cluster.work.POLL_S", 0.05)
    monkeypatch.setattr("rtsim.cluster.access.CONNECT_TIMEOUT_S", 1.0)


def nothing_else():
    return {}


def second_is_another():
    """An identity that the worker called 1 does not share."""
    with suppress(ValueError):
        return {"database": "abc" if get_worker().name != 1 else "def"}
    return {"database": "abc"}


async def answer_by_name(own, dask_worker=None):
    """The same when a worker is asked outside a piece, where it does not know itself otherwise."""
    return identity(own) | ({"database": "def"} if dask_worker.name == 1 else {})


def doubled(value, wait=0.0):
    time.sleep(wait)
    return 2 * value


def to(address, **options):
    return Cluster(address, goes_on=GOES_ON, **options)


def test_pieces_come_back_with_their_numbers(one):
    with to(one.scheduler_address) as cluster:
        assert dict(cluster.fly(nothing_else, doubled, [(1,), (2,), (3,)])) == {0: 2, 1: 4, 2: 6}
        assert list(cluster.fly(nothing_else, doubled, [])) == []
        work = cluster.fly(nothing_else, doubled, [(1,), (2,)])
        next(work)
        work.close()  # as a verdict that is certain early does
        assert dict(cluster.fly(nothing_else, doubled, [(5,)])) == {0: 10}


def fails(error):
    raise error


@pytest.mark.parametrize(
    ("error", "kind", "words"),
    [
        (InputError("is out of range", key="wind"), InputError, "wind: is out of range"),
        (OSError(28, "No space left on device"), OutputError, "No space left on device"),
        (TimeoutError("too slow"), OutputError, "TimeoutError: too slow"),
        (MemoryError(), OutputError, "MemoryError"),
        (ModuleNotFoundError("No module named 'scenarios'"), OutputError, "No module named 'scenarios'"),
        (ZeroDivisionError("by zero"), ZeroDivisionError, "by zero"),
    ],
)
def test_what_a_piece_raises(one, error, kind, words):
    with to(one.scheduler_address) as cluster, pytest.raises(kind, match=words):
        list(cluster.fly(nothing_else, fails, [(error,)]))


def test_no_workers_in_time(hurried):
    with (
        workers(0) as empty,
        to(empty.scheduler_address) as cluster,
        pytest.raises(OutputError, match=r"no workers for 0\.5 s; start some .*dask worker tcp://.*command goes on"),
    ):
        list(cluster.fly(nothing_else, doubled, [(1,)]))


def test_workers_that_come_late_are_waited_for():
    with workers(0) as empty, to(empty.scheduler_address) as cluster:
        later = threading.Timer(0.3, empty.scale, [1])
        later.start()
        assert dict(cluster.fly(nothing_else, doubled, [(1,)])) == {0: 2}
        later.join()


def test_a_worker_that_differs_is_named_with_what_differs(monkeypatch):
    monkeypatch.setattr("rtsim.cluster.work.answer", answer_by_name)
    with workers(2) as both, to(both.scheduler_address) as cluster:
        both.wait_for_workers(2)
        other = both.workers[1].address
        with pytest.raises(InputError, match=rf"{other} has database def instead of abc; give every worker") as told:
            list(cluster.fly(second_is_another, doubled, [(1,)]))
        assert both.workers[0].address not in str(told.value)


@pytest.mark.parametrize("name", ["rtsim", "python", "numba", "kernels", "sources"])
def test_code_that_differs_is_named(one, monkeypatch, name):
    real = identity_module._code()

    def code():
        with suppress(ValueError):
            get_worker()
            return real | {name: "0.0.1"}
        return real

    monkeypatch.setattr(identity_module, "_code", code)
    with to(one.scheduler_address) as cluster, pytest.raises(InputError, match=rf"has {name} 0\.0\.1 instead of"):
        list(cluster.fly(nothing_else, doubled, [(1,)]))


@pytest.mark.parametrize("looked_at", [True, False])
def test_a_worker_that_joins_later_is_checked_before_its_figures_count(monkeypatch, hurried, looked_at):
    if looked_at:
        monkeypatch.setattr("rtsim.cluster.work.answer", answer_by_name)
    else:  # then the piece itself refuses
        monkeypatch.setattr(Cluster, "_meet", lambda *_: None)
    with workers(1) as growing, to(growing.scheduler_address) as cluster:
        work = cluster.fly(second_is_another, doubled, [(number, 0.05) for number in range(100)])
        kept = [next(work)]
        growing.scale(2)
        with pytest.raises(InputError, match="has database def instead of abc"):
            kept += work
        assert all(result == 2 * number for number, result in kept)


def test_the_last_worker_lost(hurried):
    with workers(1) as shrinking, to(shrinking.scheduler_address) as cluster:
        work = cluster.fly(nothing_else, doubled, [(number, 0.1) for number in range(50)])
        next(work)
        shrinking.scale(0)
        with pytest.raises(OutputError, match="no workers for"):
            list(work)


def test_a_lost_worker_is_replaced_by_another():
    with workers(2) as shrinking, to(shrinking.scheduler_address) as cluster:
        work = cluster.fly(nothing_else, doubled, [(number, 0.05) for number in range(20)])
        found = [next(work)]
        shrinking.scale(1)
        assert dict(found + list(work)) == {number: 2 * number for number in range(20)}


@contextmanager
def process(*arguments, cwd=None, **environment):
    with subprocess.Popen(
        [sys.executable, "-m", *map(str, arguments)],
        cwd=cwd,
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as started:
        try:
            yield started
        finally:
            started.kill()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_a_worker_of_another_rtsim_and_a_scheduler_killed_in_work(tmp_path, capfd):
    (tmp_path / "rtsim").mkdir()
    (tmp_path / "rtsim" / "__init__.py").write_text("__version__ = '0.0.1'\n", encoding="utf-8")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
    worker = ("distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard", "--nthreads", 1)
    with process(*scheduler) as killed:
        other = process(*worker, PYTHONPATH=str(tmp_path), cwd=tmp_path)
        no_such = r"has rtsim 0\.0\.1, which cannot say what it is \(.*No module named"
        with to(address) as cluster, other, pytest.raises(InputError, match=no_such):
            cluster.threads(nothing_else)
        with to(address) as cluster, process(*worker):
            while True:  # until the scheduler has forgotten the other one
                with suppress(InputError):
                    cluster.threads(nothing_else)
                    break
            work = cluster.fly(nothing_else, doubled, [(number, 0.1) for number in range(100)])
            next(work)
            os.kill(killed.pid, signal.SIGKILL)
            with pytest.raises(OutputError, match=f"connection to the scheduler at {address} is lost; {GOES_ON}"):
                list(work)
    assert "Traceback" not in capfd.readouterr().err


SPEC = """format = 1
name = "small"
title = "Small"
law = "full"
runs = 1
duration_s = 5
[[classes]]
name = "c"
start = { airspeed_kt = { uniform = [50, 60] }, nacelle_deg = { uniform = [78, 88] } }
[[expect]]
name = "e"
event = "exceeded"
rate_max = 1.0
"""


@pytest.mark.parametrize("command", ["campaign", "optimize"])
@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--dask", "nonsense"], EXIT_BAD_INPUT, "is not the address"),
        (["--dask", "http://x:1"], EXIT_BAD_INPUT, "is not the address"),
        (["--dask", "tcp://127.0.0.1:0"], EXIT_BAD_INPUT, "is not the address"),
        (["--dask", "tcp://127.0.0.1:65536"], EXIT_BAD_INPUT, "is not the address"),
        (["--dask", ""], EXIT_BAD_INPUT, "is not the address"),
        (["--dask", "tcp://127.0.0.1:1", "--jobs", "2"], EXIT_BAD_INPUT, "--jobs"),
        (["--dask", "tls://127.0.0.1:1"], EXIT_BAD_INPUT, "add --dask-tls FILE"),
        (["--dask-tls", "no.toml"], EXIT_BAD_INPUT, "--dask-tls: needs a scheduler"),
        (["--dask", "tcp://127.0.0.1:1", "--dask-tls", "no.toml"], EXIT_BAD_INPUT, "write tls://"),
        (["--dask", "127.0.0.1:1", "--dask-tls", "no.toml"], EXIT_BAD_INPUT, "no.toml: "),
        (["--dask", "tcp://127.0.0.1:1"], EXIT_OUTPUT_FAILED, "no Dask scheduler answers"),
        (["--dask", "no.such.host.invalid:1"], EXIT_OUTPUT_FAILED, "no Dask scheduler answers"),
    ],
)
def test_addresses_are_judged_alike_by_both_commands(
    tmp_path, monkeypatch, capsys, hurried, command, arguments, code, words
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SPEC, encoding="utf-8")
    files = ["small.toml"] if command == "campaign" else ["--out", "best.toml"]
    assert run([command, *files, *arguments]) == code
    told = " ".join(capsys.readouterr().err.split())
    assert words in told
    assert "Traceback" not in told


@pytest.mark.parametrize("greeting", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"SSH-2.0-OpenSSH_9.2p1 Debian" * 3])
def test_a_stranger_at_the_address(hurried, greeting):
    with socket.create_server(("127.0.0.1", 0)) as server:
        taken = []

        def greet():
            with suppress(OSError):
                while True:
                    taken.append(server.accept()[0])
                    taken[-1].sendall(greeting)

        threading.Thread(target=greet, daemon=True).start()
        with pytest.raises(OutputError, match="no Dask scheduler answers"):
            to(f"127.0.0.1:{server.getsockname()[1]}")
        for connection in taken:
            connection.close()
        server.shutdown(socket.SHUT_RDWR)


def test_the_address_of_a_worker(one):
    with pytest.raises(OutputError, match="within 10 s: a Dask worker; check the address"):
        to(one.workers[0].address)


def tls_file(folder, authority, certificate, key):
    lines = f'ca_file = "{authority.name}"\ncert_file = "{certificate.name}"\nkey_file = "{key.name}"\n'
    file = folder / f"{certificate.stem}.toml"
    file.write_text(lines, encoding="utf-8")
    return file


def test_an_encrypted_cluster(tmp_path, monkeypatch, hurried):
    ours, others = Authority(tmp_path, "ours"), Authority(tmp_path, "others")
    certificate, key = ours.issue("node")
    shown = Security(
        require_encryption=True,
        tls_ca_file=str(ours.file),
        **{f"tls_{role}_{part}": str(file)
           for role in ("scheduler", "worker", "client")
           for part, file in (("cert", certificate), ("key", key))},
    )  # fmt: skip
    monkeypatch.chdir("/")  # paths stand beside the file
    known = tls_file(tmp_path, ours.file, *ours.issue("known"))
    unknown = tls_file(tmp_path, others.file, *others.issue("unknown"))
    with workers(1, protocol="tls", security=shown) as encrypted:
        address = encrypted.scheduler_address
        assert address.startswith("tls://")
        with cluster_of(address.removeprefix("tls://"), known, None, GOES_ON) as cluster:
            assert dict(cluster.fly(nothing_else, doubled, [(4,)])) == {0: 8}
        with pytest.raises(OutputError, match="no Dask scheduler, with certificates of this authority"):
            to(address, tls=unknown)
        with pytest.raises(OutputError, match="no Dask scheduler answers"):
            to(address.replace("tls://", "tcp://"))
    with workers(1) as plain, pytest.raises(OutputError, match="no Dask scheduler, with certificates"):
        to(plain.scheduler_address.replace("tcp://", "tls://"), tls=known)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("ca_file", "none.pem"), "none.pem: does not exist"),
        (("key_file", "none.key"), "none.key: does not exist"),
        (("cert_file", "text.pem"), "text.pem: is no certificate or key"),
        (("ca_file", "hollow.pem"), "hollow.pem: cannot be used as ca_file"),
        (("key_file", "stranger.key"), "key values mismatch"),
        (("key_file", "locked.key"), "locked.key: is locked by a passphrase"),
        (("key_file", "."), "is a directory"),
        (("secret", "x"), "secret"),
    ],
)
def test_a_certificate_that_cannot_be_used(tmp_path, change, words):
    authority = Authority(tmp_path, "ca")
    certificate, key = authority.issue("node")
    authority.issue("stranger")
    (tmp_path / "text.pem").write_text("a text", encoding="utf-8")
    (tmp_path / "hollow.pem").write_text("-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n")
    (tmp_path / "locked.key").write_text(LOCKED, encoding="ascii")
    file = tls_file(tmp_path, authority.file, certificate, key)
    lines = dict(line.split(" = ") for line in file.read_text().splitlines()) | {change[0]: f'"{change[1]}"'}
    file.write_text("".join(f"{name} = {value}\n" for name, value in lines.items()), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        to("tls://127.0.0.1:1", tls=file)


LOCKED = """-----BEGIN EC PRIVATE KEY-----
Proc-Type: 4,ENCRYPTED
DEK-Info: AES-128-CBC,00112233445566778899AABBCCDDEEFF

AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA
-----END EC PRIVATE KEY-----
"""


def test_threads_that_ask_first_get_the_same_aircraft(monkeypatch):
    read = profile.shipped_toml

    def slowly(*names):
        time.sleep(0.01)  # others come meanwhile
        return read(*names)

    monkeypatch.setattr(profile, "_xv15_profile", functools.cache(profile._xv15_profile.__wrapped__))
    monkeypatch.setattr(profile, "shipped_toml", slowly)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: profile.xv15_profile(), range(4)))
    assert len({id(made) for made in found}) == 1


LAW = """class Idle:
    def step(self, sensors, command, margins, dt):
        return command, []
"""


def test_a_law_is_known_as_it_was_loaded(tmp_path):
    law = tmp_path / "law_of_a_cluster.py"
    law.write_text(LAW, encoding="utf-8")
    task = Task("", "", (LawVariant("law_of_a_cluster:Idle"),), 0, FlightOptions(), str(tmp_path))
    loaded = task_identity(task)
    assert "law law_of_a_cluster:Idle" in loaded
    law.write_text(LAW + "# another\n", encoding="utf-8")
    assert task_identity(task) == loaded  # what flies is what was loaded
    missing = Task("", "", (LawVariant("law_of_nobody:Idle"),), 0, FlightOptions(), str(tmp_path))
    assert "law_of_nobody" in task_identity(missing)["laws"]
