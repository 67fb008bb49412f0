"""What the terminal shows while a flight goes on: what happens, in order, and the panel below it; in a pipe, lines."""

from __future__ import annotations

import shutil
import sys
import textwrap
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rtsim.cli.flight_panel import STYLES, Alarms, Line, Pace, panel, who_flies
from rtsim.cli.flight_text import say
from rtsim.cli.output import console, progress
from rtsim.frame import COLUMN
from rtsim.terminal import in_foreground

if TYPE_CHECKING:
    from rtsim.arrays import FloatArray
    from rtsim.realtime.control import FlightControl
    from scenarios.files.scenario import Scenario
    from telemetry.log.format import LogEvent

PERIOD_S = 0.25
"""Time between two pictures of the panel [s]."""
AWAY_S = 1.5
"""A panel not drawn for as long is no longer the last thing on the screen: the shell has written there [s]."""
MAX_EVENT_LINES = 40
"""Events told while flying; a flight along a boundary has more than anyone reads."""


class FlightScreen:
    """Panel and events of a running flight. The loop only leaves values here; another thread prints them."""

    def __init__(self, scenario: Scenario, control: FlightControl, *, paced: bool, by_hand: bool) -> None:
        """Prepare.

        Args:
            control: Tells whether the flight is paused, its speed and its backlog.
            paced: Whether it is flown on the wall clock.
            by_hand: Whether a command from outside is a person's.
        """
        self.first_frame_s: float | None = None
        """How long after the command the first frame began [s]."""
        self._scenario, self._control, self._paced = scenario, control, paced
        self._external = "you" if by_hand else scenario.options.pilot.rpartition(":")[2]
        self._row: FloatArray | None = None
        self._news: deque[LogEvent | str] = deque()
        self._events = 0
        self._closing = threading.Event()
        self._advance: Callable[[float], None] | None = None
        self._shown_s = 0.0
        self._pace, self._alarms = Pace(), Alarms()
        self._drawn: tuple[int, int, float] | None = None  # lines, columns and the moment of the panel on the screen

    def on_rows(self, row: FloatArray) -> None:
        """Take the last row flown.

        Args:
            row: The frame; it must not change later.
        """
        self._row = row
        if self._advance is not None:
            time_s = float(row[COLUMN.time_s])
            self._advance(max(0.0, time_s - self._shown_s))
            self._shown_s = time_s

    def on_event(self, event: LogEvent) -> None:
        """Take an event.

        Args:
            event: What happened.
        """
        if event.kind != "view":  # it has said that itself
            self._news.append(event)

    def say(self, sentence: str) -> None:
        """Print a sentence, above the panel where there is one.

        Args:
            sentence: What to say.
        """
        self._news.append(sentence)
        if self._row is None or not self._paced:
            self._tell_news()

    @contextmanager
    def running(self) -> Iterator[None]:
        """Show progress while the block runs, and everything that is left to say after it."""
        thread = None
        if self._paced:
            thread = threading.Thread(target=self._keep_telling, name="status", daemon=True)
            thread.start()
        try:
            if self._paced or not sys.stderr.isatty():
                yield
            else:
                with progress(f"Flying {self._scenario.name}", total=self._scenario.duration) as advance:
                    self._advance = advance
                    yield
        finally:
            self._advance = None
            self._closing.set()
            if thread is not None:
                thread.join(timeout=2.0)
            self._clear_panel()
            self._tell_news()

    def _keep_telling(self) -> None:
        while not self._closing.wait(PERIOD_S):
            if self._news:
                self._clear_panel()
                self._tell_news()
            if self._row is not None and _takes_panel():
                self._draw_panel(self._row)

    def _draw_panel(self, row: FloatArray) -> None:
        now, options = time.monotonic(), self._scenario.options
        width = shutil.get_terminal_size().columns
        lines = panel(
            row,
            self._control,
            pace=self._pace.of(now, float(row[COLUMN.time_s])),
            duration_s=self._scenario.duration,
            who=who_flies(row, external=self._external, protection=options.protection),
        )
        lines.append(self._alarms.line())
        up = "\r"
        if self._drawn is not None:
            count, columns, moment = self._drawn
            stays = columns == width and now - moment < AWAY_S
            up = f"\r\x1b[{count - 1}A" if stays else "\n"
        sys.stderr.write(up + "\n".join(f"{_coloured(line, width)}\x1b[K" for line in lines))
        sys.stderr.flush()
        self._drawn = len(lines), width, now

    def _clear_panel(self) -> None:
        if self._drawn is not None:
            count, _, moment = self._drawn
            away = time.monotonic() - moment > AWAY_S
            sys.stderr.write("\n" if away else f"\r\x1b[{count - 1}A\x1b[J")
            sys.stderr.flush()
            self._drawn = None

    def _tell_news(self) -> None:
        while self._news:
            news = self._news.popleft()
            if isinstance(news, str):
                say(news)
                continue
            self._alarms.take(news)
            if news.kind == "end":
                continue
            self._events += 1
            if self._events <= MAX_EVENT_LINES:
                say(_hanging(f"{news.time_s:8.2f} s  {news.text}"), style=STYLES.get(news.level))
            elif self._events == MAX_EVENT_LINES + 1:
                say("            (further events are in the log)")


def _takes_panel() -> bool:
    """Whether stderr is a terminal that is ours now and can move its cursor."""
    terminal = sys.stderr.isatty() and not console.is_dumb_terminal
    return terminal and in_foreground(sys.stderr.fileno(), foreign=True)


def _hanging(sentence: str) -> str:
    """An event whose further lines stand under its first words; one line in a pipe."""
    if not console.is_terminal:
        return sentence
    return textwrap.fill(sentence, console.width - 1, subsequent_indent=" " * 12)


def _coloured(line: Line, width: int) -> str:
    text = line.text(width)
    if line.style is None or console.real().color_system is None:
        return text
    from rich.style import Style

    return Style.parse(line.style).render(text)
