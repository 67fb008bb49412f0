"""Files that are whole or not there: written under a temporary name, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rtsim.errors import OutputError


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name beside the target; renamed at the end, so that a file is whole or not there.

    Args:
        path: The target; an existing file is replaced.

    Yields:
        The temporary path to write, with the suffix of the target.

    Raises:
        OutputError: Writing or renaming failed; an older file still stands.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror or error}.") from error
    finally:
        # After success there is nothing left under this name; after Ctrl-C or a fault there must not be.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file at once.

    Args:
        path: The target; an existing file is replaced.
        content: Text, written as UTF-8, or bytes.

    Raises:
        OutputError: It cannot be written; an older file still stands.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
