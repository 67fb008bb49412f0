"""Verdicts as JUnit XML, which every CI reads: one testcase per scenario or campaign, metrics as properties."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd]")


@dataclass(frozen=True, slots=True, kw_only=True)
class JunitCase:
    """One testcase."""

    name: str
    """What was tested."""
    suite: str
    """What it belongs to, such as ``rtsim.test.full``."""
    seconds: float
    """Time it took [s]."""
    properties: Mapping[str, object] = field(default_factory=dict)
    """Metrics by name."""
    failures: Sequence[str] = ()
    """Clauses that did not hold, as ``metric=value want limit``."""
    error: str = ""
    """What kept it from being judged, or what broke in the code under test; wins over failures."""


def junit_xml(name: str, cases: Sequence[JunitCase]) -> bytes:
    """Write a JUnit document.

    Args:
        name: Name of the test suite.
        cases: The testcases.

    Returns:
        The XML in UTF-8.
    """
    failed = sum(bool(case.failures) and not case.error for case in cases)
    errors = sum(bool(case.error) for case in cases)
    counts = {
        "name": name,
        "tests": str(len(cases)),
        "failures": str(failed),
        "errors": str(errors),
        "time": f"{sum(case.seconds for case in cases):.3f}",
    }
    root = ET.Element("testsuites", counts)
    suite = ET.SubElement(root, "testsuite", counts)
    for case in cases:
        element = ET.SubElement(
            suite, "testcase", {"name": _text(case.name), "classname": _text(case.suite), "time": f"{case.seconds:.3f}"}
        )
        if case.properties:
            properties = ET.SubElement(element, "properties")
            for key, value in case.properties.items():
                ET.SubElement(properties, "property", {"name": _text(key), "value": _value(value)})
        if case.error:
            words = "\n".join([case.error, *case.failures])
            ET.SubElement(element, "error", {"message": _text(case.error), "type": "error"}).text = _text(words)
        elif case.failures:
            words = "\n".join(case.failures)
            ET.SubElement(
                element, "failure", {"message": _text("; ".join(case.failures)), "type": "expectation"}
            ).text = _text(words)
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.9g}" if math.isfinite(value) else "nan"
    return _text(str(value))


def _text(text: str) -> str:
    """Text without the characters that XML cannot hold."""
    return _FORBIDDEN.sub("?", text)
