"""Files from outside: the one place that opens them, and that turns every failure to understand one into a sentence.

Text is UTF-8, with or without a byte order mark. A file may be a pipe where it is read as text; what libraries read
(databases, logs, records) must be a regular file. Sizes are bounded before anything is read.
"""

from __future__ import annotations

import os
import select
import stat
import time
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtsim.errors import InputError, RtsimError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

PATIENCE_S = 10.0
"""How long a pipe or device may take to give its whole content [s]."""
LARGEST_TEXT = 1_000_000
"""A larger text is refused before it is read, unless its reader allows more [bytes]."""
_MARKS = {b"\xff\xfe\x00\x00": "UTF-32", b"\x00\x00\xfe\xff": "UTF-32", b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}
_LONGEST_REASON = 200


def status_of(place: Path) -> os.stat_result | None:
    """Look once at what is at a place, or None where nothing is: what is asked twice may have changed meanwhile.

    Args:
        place: The place; links are followed.
    """
    try:
        return place.stat()
    except FileNotFoundError:
        return None


def named(path: str | os.PathLike[str]) -> Path:
    """The path that somebody gave.

    Args:
        path: The path.

    Raises:
        InputError: It is no path.
    """
    try:
        return Path(path)
    except TypeError:
        raise InputError("is no path", key="path", value=path, mend="give the name of a file") from None


def regular_file(path: str | Path, *, noun: str, largest: int, missing: str = "check the path") -> Path:
    """A file that a library may open: there, regular, not empty, not too large, readable.

    Args:
        path: The file.
        noun: What it should be, without article.
        largest: Size of the largest file that is read [bytes].
        missing: What to do where there is none.

    Raises:
        InputError: It is not.
    """
    file, shown = named(path), str(path)
    with opening(file, missing):
        status = file.stat()
        _refuse_by_kind(status, shown, noun, largest)
        if not stat.S_ISREG(status.st_mode):
            raise InputError("is a pipe or a device", file=shown, mend=f"write the {noun} to a file first")
        if not status.st_size:
            raise InputError("is empty", file=shown, mend=f"name a {noun} file, or make it anew")
        with file.open("rb"):
            return file


def read_bytes(path: str | Path, *, noun: str, largest: int, missing: str = "check the path") -> bytes:
    """The content of a file or a pipe.

    Args:
        path: The file.
        noun: What it should be, without article.
        largest: Size of the largest content that is read [bytes].
        missing: What to do where there is none.

    Raises:
        InputError: It is not there, no file, too large, does not end, or must not be read.
    """
    file, shown = named(path), str(path)
    with opening(file, missing):
        status = file.stat()
        _refuse_by_kind(status, shown, noun, largest)
        if stat.S_ISREG(status.st_mode):
            with file.open("rb") as stream:
                data = stream.read(status.st_size + 1) or stream.read(LARGEST_TEXT)
        else:
            data = _streamed(file, shown, noun, largest)
    if len(data) > largest:
        raise _too_large(shown, noun, largest)
    return data


def read_text(
    path: str | Path,
    *,
    noun: str,
    largest: int = LARGEST_TEXT,
    missing: str = "check the path",
    may_be_empty: bool = False,
) -> str:
    """The text of a file or a pipe.

    Args:
        path: The file.
        noun: What it should be, without article.
        largest: Size of the largest text that is read [bytes].
        missing: What to do where there is none.
        may_be_empty: Whether an empty text means something.

    Raises:
        InputError: It cannot be read, or is no UTF-8 text.
    """
    text = as_text(read_bytes(path, noun=noun, largest=largest, missing=missing), file=str(path))
    if not may_be_empty and not text.strip():
        raise InputError("is empty", file=str(path), mend=f"write a {noun} into it")
    return text


def as_text(data: bytes, *, file: str) -> str:
    """Decode a text; a byte order mark is passed over.

    Args:
        data: Its bytes.

    Raises:
        InputError: It is in another encoding, or no text.
    """
    mend = "save it as UTF-8"
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            raise InputError(f"is {name} text", file=file, allowed="UTF-8", mend=mend)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place, problem = error.start, "is not UTF-8"
    else:
        place, problem = data.find(b"\0"), "is 0"
        if place < 0:
            return text
    line = data.count(b"\n", 0, place) + 1
    raise InputError(f"is not a text file (line {line}: byte {place} {problem})", file=file, mend=mend)


@contextmanager
def opening(file: Path, missing: str) -> Iterator[None]:
    """What the system refuses when a file or folder is opened, as sentences.

    Args:
        file: What is opened inside.
        missing: What to do where there is none.

    Raises:
        InputError: It is not there, or must not be read.
    """
    shown = str(file)
    try:
        yield
    except (FileNotFoundError, NotADirectoryError):
        if file.is_symlink():
            raise InputError("is a link to a file that does not exist", file=shown, mend=missing) from None
        raise InputError("does not exist", file=shown, mend=missing) from None
    except OSError as error:
        reason = error.strerror or str(error)
        problem = f"cannot be read: {reason[:1].lower()}{reason[1:]}"
        raise InputError(problem, file=shown, mend="check its permissions and its name") from None
    except ValueError:  # a 0 in the name
        raise InputError("is no name of a file", file=shown, mend=missing) from None


@contextmanager
def understanding(noun: str, *, file: str | Path, mend: str) -> Iterator[None]:
    """Whatever a library raises while it understands a file is the file's fault, and one sentence.

    Nothing but the understanding of the file may stand inside.

    Args:
        noun: What it should be, without article.
        mend: What to do about it, as an imperative.

    Raises:
        InputError: Something went wrong inside; errors that are sentences already pass.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # libraries mutter about damaged files besides
            yield
    except RtsimError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:_LONGEST_REASON] or type(error).__name__
        if isinstance(error, KeyError):
            reason = f"{reason} is missing"
        raise InputError(f"is damaged, or no {noun}: {reason}", file=str(file), mend=mend) from error


def read_arrays(path: str | Path, *, noun: str, largest: int, mend: str) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays of an ``.npz`` file.

    Args:
        path: The file.
        noun: What it should be, without article.
        largest: Size of the largest content, unpacked [bytes].
        mend: What to do about a file that cannot be read, as an imperative.

    Raises:
        InputError: It cannot be read, is damaged, or too large.
    """
    import io

    from numpy.lib import format as arrays

    file = regular_file(path, noun=noun, largest=largest, missing=mend)
    found: dict[str, Any] = {}
    with understanding(noun, file=file, mend=mend), zipfile.ZipFile(file) as archive:
        if sum(max(entry.file_size, entry.compress_size) for entry in archive.infolist()) > largest:
            raise _too_large(str(file), noun, largest)
        for entry in archive.infolist():
            if entry.compress_type not in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
                # numpy writes no other; a damaged one has its reader prepare for gigabytes.
                raise InputError(f"is damaged, or no {noun}", file=str(file), mend=mend)
            content = archive.read(entry)  # its check sum is verified before numpy sees it
            array = arrays.read_array(io.BytesIO(content), allow_pickle=False)
            found[entry.filename.removesuffix(".npy")] = array
    return found


def _refuse_by_kind(status: os.stat_result, shown: str, noun: str, largest: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise InputError("is a directory", file=shown, mend=f"name a {noun} file")
    if stat.S_ISBLK(status.st_mode):
        raise InputError("is a disk", file=shown, mend=f"name a {noun} file")
    if status.st_size > largest:
        raise _too_large(shown, noun, largest)


def _too_large(shown: str, noun: str, largest: int) -> InputError:
    return InputError(
        f"is too large for a {noun}", file=shown, allowed=f"at most {largest} bytes", mend=f"name a {noun} file"
    )


def _streamed(file: Path, shown: str, noun: str, largest: int) -> bytes:
    """What a pipe or a device gives until it ends; one that does not is refused."""
    handle = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
    try:
        poll, end = select.poll(), time.monotonic() + PATIENCE_S
        poll.register(handle, select.POLLIN)
        data = bytearray()
        while len(data) <= largest:
            if not poll.poll(max(0.0, end - time.monotonic()) * 1000.0):
                problem = f"is a pipe or a device that does not end within {PATIENCE_S:g} s"
                raise InputError(problem, file=shown, mend=f"write the {noun} to a file first")
            part = os.read(handle, 1 << 16)
            if not part:
                break
            data += part
        return bytes(data)
    finally:
        os.close(handle)
