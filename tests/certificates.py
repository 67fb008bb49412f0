"""Certificates for tests of encrypted connections, made from numbers alone: X.509 in DER, ECDSA on P-256."""

from __future__ import annotations

import base64
import hashlib
import secrets
from datetime import UTC, datetime, timedelta
from pathlib import Path

P = 2**256 - 2**224 + 2**192 + 2**96 - 1
ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
BASE = (
    0x6B17D1F2E12C4247F8BCE6E563A440F277037D812DEB33A0F4A13945D898C296,
    0x4FE342E2FE1A7F9B8EE7EB4A7C0F9E162BCE33576B315ECECBB6406837BF51F5,
)
CURVE = bytes.fromhex("06082a8648ce3d030107")
EC_KEY = bytes.fromhex("06072a8648ce3d0201")
COMMON_NAME, AUTHORITY = bytes.fromhex("0603550403"), bytes.fromhex("0603551d13")


def _der(tag: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    size = len(body).to_bytes((len(body).bit_length() + 7) // 8 or 1, "big")
    return bytes([tag]) + (size if len(body) < 128 else bytes([128 + len(size)]) + size) + body


def _int(value: int) -> bytes:
    return _der(2, value.to_bytes(value.bit_length() // 8 + 1, "big"))


def _add(a, b):
    if a is None or b is None:
        return a or b
    if a[0] == b[0] and (a[1] + b[1]) % P == 0:
        return None
    slope = (3 * a[0] ** 2 - 3) * pow(2 * a[1], -1, P) if a == b else (b[1] - a[1]) * pow(b[0] - a[0], -1, P)
    x = (slope**2 - a[0] - b[0]) % P
    return x, (slope * (a[0] - x) - a[1]) % P


def _times(count: int):
    total, point = None, BASE
    while count:
        total = _add(total, point) if count & 1 else total
        point, count = _add(point, point), count >> 1
    return total


def _pem(label: str, content: bytes) -> str:
    return f"-----BEGIN {label}-----\n{base64.encodebytes(content).decode()}-----END {label}-----\n"


class Authority:
    """Signs certificates."""

    def __init__(self, folder: Path, name: str) -> None:
        """Make the authority's own certificate: ``NAME.pem``."""
        self.name, self._folder, self._key = name, folder, secrets.randbelow(ORDER - 1) + 1
        self.file = self._write(name, self._key, authority=True)

    def issue(self, name: str) -> tuple[Path, Path]:
        """Make a certificate and its key: ``NAME.pem`` and ``NAME.key``."""
        key = secrets.randbelow(ORDER - 1) + 1
        return self._write(name, key), self._folder / f"{name}.key"

    def _write(self, name: str, key: int, *, authority: bool = False) -> Path:
        x, y = _times(key)
        public = _der(3, b"\0\4" + x.to_bytes(32, "big") + y.to_bytes(32, "big"))
        algorithm = _der(0x30, bytes.fromhex("06082a8648ce3d040302"))
        issuer, subject = (
            _der(0x30, _der(0x31, _der(0x30, COMMON_NAME, _der(12, words.encode())))) for words in (self.name, name)
        )
        now = datetime.now(UTC)
        dates = (f"{now + timedelta(days=days):%Y%m%d%H%M%SZ}".encode() for days in (-1, 1))
        rights = _der(0x30, AUTHORITY, _der(4, _der(0x30, _der(1, b"\xff") if authority else b"")))
        content = _der(
            0x30,
            _der(0xA0, _int(2)),
            _int(secrets.randbits(64)),
            algorithm,
            issuer,
            _der(0x30, *(_der(24, date) for date in dates)),
            subject,
            _der(0x30, _der(0x30, EC_KEY, CURVE), public),
            _der(0xA3, _der(0x30, rights)),
        )
        once = secrets.randbelow(ORDER - 1) + 1
        r = _times(once)[0] % ORDER
        s = pow(once, -1, ORDER) * (int.from_bytes(hashlib.sha256(content).digest(), "big") + r * self._key) % ORDER
        signature = _der(3, b"\0" + _der(0x30, _int(r), _int(s)))
        private = _der(0x30, _int(1), _der(4, key.to_bytes(32, "big")), _der(0xA0, CURVE), _der(0xA1, public))
        file = self._folder / f"{name}.pem"
        file.write_text(_pem("CERTIFICATE", _der(0x30, content, algorithm, signature)), encoding="ascii")
        (self._folder / f"{name}.key").write_text(_pem("EC PRIVATE KEY", private), encoding="ascii")
        return file
