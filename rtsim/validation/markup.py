"""A report as a list of blocks, written as Markdown or as one HTML page that needs nothing else."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_STYLE = """
:root { color-scheme: light }
body { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; margin: 2rem auto; max-width: 80rem; padding: 0 1rem;
color: #1c2430; background: #fff }
h1 { margin-bottom: .2rem } h2 { margin-top: 2.6rem; border-top: 2px solid #d8dee6; padding-top: 1rem }
h3 { margin: 1.8rem 0 .2rem; font-size: 1.02rem } p { max-width: 56rem; margin: .3rem 0 .6rem }
.wide { overflow-x: auto } table { border-collapse: collapse; margin: .4rem 0 1.2rem; font-size: 13.5px }
th, td { padding: .22rem .6rem; text-align: left; border-bottom: 1px solid #e1e6ec; vertical-align: top }
thead th { background: #f2f5f8 } td { font-variant-numeric: tabular-nums }
.holds { color: #12703a } .misses { color: #b3261e; font-weight: 600 } .other { color: #56606c }
figure { margin: 1rem 0 1.6rem } img { max-width: 100%; border: 1px solid #e1e6ec } figcaption { color: #3c4755 }
code { font-size: 12.5px; color: #445 }
"""


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading."""

    text: str
    """Its words."""
    level: int
    """1 is the title."""


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A paragraph; ``code`` in backticks and **stress** in asterisks."""

    text: str
    """Its words."""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table."""

    head: tuple[str, ...]
    """Headings of the columns."""
    rows: tuple[tuple[str, ...], ...]
    """Cells."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that was drawn."""

    stem: str
    """File name without ending."""
    title: str
    """What it shows."""


Block = Heading | Paragraph | Grid | Picture


def markdown(blocks: Sequence[Block]) -> str:
    """Write Markdown.

    Args:
        blocks: The report.
    """
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def _markdown(block: Block) -> str:
    if isinstance(block, Heading):
        return f"{'#' * block.level} {block.text}"
    if isinstance(block, Paragraph):
        return block.text
    if isinstance(block, Picture):
        return f"![{block.title}](figures/{block.stem}.png)"
    lines = [block.head, tuple("---" for _ in block.head), *block.rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in lines)


def page(blocks: Sequence[Block], pictures: Mapping[str, Path], *, title: str) -> str:
    """Write HTML.

    Args:
        blocks: The report.
        pictures: SVG files by stem.
        title: Title of the window.
    """
    body = "\n".join(_html(block, pictures) for block in blocks)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{html.escape(title)}</title>\n'
        f"<style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def _inline(text: str) -> str:
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
    return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)


def _html(block: Block, pictures: Mapping[str, Path]) -> str:
    if isinstance(block, Heading):
        return f"<h{block.level}>{_inline(block.text)}</h{block.level}>"
    if isinstance(block, Paragraph):
        return f"<p>{_inline(block.text)}</p>"
    if isinstance(block, Picture):
        data = base64.b64encode(pictures[block.stem].read_bytes()).decode("ascii")
        title = html.escape(block.title)
        image = f'<img alt="{title}" src="data:image/svg+xml;base64,{data}">'
        return f"<figure>{image}<figcaption>{title}</figcaption></figure>"
    head = "".join(f"<th>{_inline(cell)}</th>" for cell in block.head)
    rows = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in block.rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _cell(cell: str) -> str:
    word = cell.split(" ", maxsplit=1)[0].strip(",*")
    kind = word if word in {"holds", "misses"} else "other" if word in {"reported", "not"} else ""
    return f'<td class="{kind}">{_inline(cell)}</td>' if kind else f"<td>{_inline(cell)}</td>"
