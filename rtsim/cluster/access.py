"""The way to a Dask scheduler: its address, the certificates of an encrypted one, and whether it is one at all.

Legend:
    address: The scheduler's address, as the user wrote it.
"""

from __future__ import annotations

import asyncio
import re
import ssl
from pathlib import Path
from typing import Any

from rtsim.errors import InputError, OutputError
from rtsim.outside import read_text
from rtsim.strict import Strict, checked
from rtsim.toml_file import read_toml

CONNECT_TIMEOUT_S = 10.0
"""How long a scheduler may take to answer [s]."""
_ADDRESS = re.compile(r"(?:(tcp|tls)://)?((?:\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5}))", re.ASCII)
_ALLOWED = "tcp://HOST:PORT, tls://HOST:PORT or HOST:PORT"


class TlsFile(Strict):
    """Certificates of an encrypted cluster; paths are relative to the file."""

    ca_file: str
    """Certificate of the authority that signed the scheduler's, the workers' and this one's (PEM)."""
    cert_file: str
    """Certificate that this process shows (PEM)."""
    key_file: str
    """Its private key, without passphrase (PEM)."""


def scheduler_address(address: str, *, encrypted: bool) -> str:
    """The address with its protocol.

    Args:
        encrypted: Whether certificates were given.

    Raises:
        InputError: It is malformed, or its protocol and the certificates do not fit together.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found[3]) <= 65535:
        raise InputError("is not the address of a Dask scheduler", key="--dask", value=address, allowed=_ALLOWED)
    protocol = found[1] or ("tls" if encrypted else "tcp")
    if protocol == "tls" and not encrypted:
        raise InputError(
            "an encrypted scheduler needs certificates", key="--dask", value=address, mend="add --dask-tls FILE"
        )
    if protocol == "tcp" and encrypted:
        raise InputError(
            "certificates were given for a connection that is not encrypted",
            key="--dask",
            value=address,
            mend="write tls://, or leave --dask-tls out",
        )
    return f"{protocol}://{found[2]}"


def security(file: Path) -> Any:
    """Read the certificates that a file names.

    Args:
        file: The TOML file of ``--dask-tls``.

    Returns:
        A ``distributed.Security`` that refuses what is not encrypted.

    Raises:
        InputError: The file, a certificate or the key cannot be used.
    """
    import distributed

    tls = checked(TlsFile, read_toml(file, noun="file of certificates"), file=str(file))
    paths = {key: str(file.parent / name) for key, name in tls.model_dump().items()}
    for key, path in paths.items():
        if "-----BEGIN" not in read_text(path, noun="certificate or key", missing=f"mend {key} in {file}"):
            raise InputError("is no certificate or key", file=path, allowed="PEM", mend=f"mend {key} in {file}")
    try:
        context = ssl.create_default_context(cafile=paths["ca_file"])
    except ssl.SSLError as error:
        raise _unusable("ca_file", paths["ca_file"], error, file) from None
    try:
        context.load_cert_chain(paths["cert_file"], paths["key_file"], password=lambda: _asks(paths["key_file"]))
    except ssl.SSLError as error:
        raise _unusable("cert_file with its key_file", paths["cert_file"], error, file) from None
    made: Any = distributed.Security  # partly typed, and absent where only the checker runs
    return made(
        tls_ca_file=paths["ca_file"],
        tls_client_cert=paths["cert_file"],
        tls_client_key=paths["key_file"],
        require_encryption=True,
    )


def _unusable(key: str, path: str, error: ssl.SSLError, file: Path) -> InputError:
    reason = (error.reason or "no certificate in it").replace("_", " ").lower()
    return InputError(f"cannot be used as {key} ({reason})", file=path, mend=f"mend it, or name another in {file}")


def _asks(path: str) -> str:
    raise InputError("is locked by a passphrase", file=path, mend="give a key without one that only you can read")


def require_scheduler(address: str, certificates: Any) -> None:
    """Ask who answers, within a time: to a stranger, Dask's own client would listen for ever.

    Args:
        certificates: A ``distributed.Security``, or None.

    Raises:
        OutputError: Nobody, or nobody who is a Dask scheduler.
    """
    import distributed.core

    dask: Any = distributed.core  # partly typed, and absent where only the checker runs
    arguments: dict[str, Any] = {} if certificates is None else certificates.get_connection_args("client")

    async def who() -> str:
        comm = await dask.connect(address, timeout=CONNECT_TIMEOUT_S, **arguments)
        try:
            return str((await dask.send_recv(comm, op="identity"))["type"])
        finally:
            comm.abort()

    async def in_time() -> str:
        return await asyncio.wait_for(who(), CONNECT_TIMEOUT_S)

    reason = ""
    try:
        kind = asyncio.run(in_time())
    except Exception as error:  # noqa: BLE001 - what a stranger says can fail in any way
        kind, reason = "", _reason(error)
    if kind != "Scheduler":
        who_answers = f"a Dask {kind.lower()}" if kind else f"nobody who is one{reason}"
        encrypted = ", with certificates of this authority," if certificates is not None else ""
        raise OutputError(
            f"--dask: no Dask scheduler{encrypted} answers at {address} within {CONNECT_TIMEOUT_S:g} s: {who_answers}; "
            "check the address, or start one with: dask scheduler."
        )


def _reason(error: BaseException) -> str:
    """The innermost cause in a few words."""
    while error.__cause__ is not None:
        error = error.__cause__
    words = " ".join(str(error).split())[:150]
    return f" ({words})" if words and isinstance(error, (OSError, ssl.SSLError)) else ""
