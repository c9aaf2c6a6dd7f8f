"""Recorded CAN traffic becomes a drive: candump logs, Vector ASC and BLF files."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import Progress

from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, Sample, ScalarSample
from lfd_replay.drive import LATEST
from lfd_replay.errors import WrongOption
from lfd_replay.recordings.esr import EsrDecoder, Scan, select_lead
from lfd_replay.recordings.lead_selection import HostMotion, LeadSelector
from lfd_replay.units import KM_PER_H, MPH, STANDARD_GRAVITY

if TYPE_CHECKING:
    import can

SUFFIXES = (".log", ".asc", ".blf")

Frame = tuple[int, int, bytes]
"""Stamp in ns, identifier, data."""

UNITS = {
    "m/s": 1.0, "mps": 1.0, "km/h": KM_PER_H, "kph": KM_PER_H, "kmh": KM_PER_H, "mph": MPH,
    "m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "mps2": 1.0, "g": STANDARD_GRAVITY,
}  # fmt: skip
"""Units of a DBC, in lower case, that are understood, in m/s or m/s^2."""


@dataclass(frozen=True)
class HostSignals:
    """Names of signals in the car's own DBC; None = not on CAN."""

    dbc: Path
    speed: str | None
    acceleration: str | None

    @property
    def inputs(self) -> tuple[str, ...]:
        """The inputs that are on CAN."""
        named = {HOST_SPEED: self.speed, ACCELERATION: self.acceleration}
        return tuple(name for name, signal in named.items() if signal)


class _Signal:
    """One signal of the car's own CAN."""

    def __init__(self, database: Any, file: Path, name: str, input_name: str) -> None:
        wanted_message, _, wanted = name.rpartition(".")
        found = [
            (message, signal)
            for message in database.messages
            for signal in message.signals
            if signal.name == wanted and wanted_message in ("", message.name)
        ]
        if len(found) != 1:
            there = ", ".join(
                sorted(f"{m.name}.{s.name}" for m in database.messages for s in m.signals)[:20]
            )
            what = "no such signal" if not found else "more than one, name it as MESSAGE.SIGNAL"
            raise WrongOption(f"{file}: {name}: {what}; there are: {there}")
        self.message, signal = found[0]
        unit = (signal.unit or "").strip().lower()
        if unit and unit not in UNITS:
            raise WrongOption(
                f"{file}: {name}: unit '{signal.unit}' is not understood; known: {', '.join(UNITS)}"
            )
        self.name, self.input = signal.name, input_name
        self.factor = UNITS.get(unit, 1.0)

    def value(self, data: bytes) -> float | None:
        """In m/s or m/s^2; None from a damaged frame."""
        from cantools.database import DecodeError

        try:
            decoded = self.message.decode(data, decode_choices=False)
            return float(decoded[self.name]) * self.factor
        except (DecodeError, ValueError, KeyError):
            return None


def _host_signals(host: HostSignals) -> dict[int, list[_Signal]]:
    """The wanted signals by frame identifier. Raises UserError."""
    import cantools

    try:
        database = cantools.database.load_file(host.dbc)
    except (OSError, ValueError, cantools.Error) as error:
        detail = " ".join(str(error).split())[:200]
        raise WrongOption(f"{host.dbc}: cannot be read as a DBC file ({detail})") from error
    by_frame: dict[int, list[_Signal]] = {}
    for name, input_name in ((host.speed, HOST_SPEED), (host.acceleration, ACCELERATION)):
        if name:
            signal = _Signal(database, host.dbc, name, input_name)
            by_frame.setdefault(signal.message.frame_id, []).append(signal)
    return by_frame


class CanDrive:
    """Frames in, samples out: the radar's lead and the host's signals."""

    def __init__(self, host: HostSignals | None, motion: HostMotion | None = None) -> None:
        """`motion` is shared with whoever hears of the host elsewhere than on CAN.

        Raises UserError for a DBC file or signal that is not there.
        """
        self._esr = EsrDecoder()
        self._host = {} if host is None else _host_signals(host)
        self._motion = motion or HostMotion()
        self.counts = self._esr.counts
        self._selector = LeadSelector(self.counts)

    def push(self, frame: Frame) -> Iterator[Sample]:
        """Take one frame; gives the samples that it completes."""
        yield from self.push_host(frame)
        stamp, identifier, data = frame
        if identifier not in self._host:
            yield from map(self._lead, self._esr.push(stamp, identifier, data))

    def push_host(self, frame: Frame) -> Iterator[Sample]:
        """Take one frame of a bus that has no radar that counts: only of the host's signals."""
        stamp, identifier, data = frame
        for signal in self._host.get(identifier, ()):
            value = signal.value(data)
            if value is None:
                self.counts["damaged frames of the host"] += 1
                continue
            sample = ScalarSample(signal.input, stamp, value)
            if signal.input == HOST_SPEED:
                self._motion.hear(speed=sample.value)
            yield sample

    def flush(self) -> Iterator[Sample]:
        """What the end of the recording has cut off."""
        yield from map(self._lead, self._esr.flush())

    def _lead(self, scan: Scan) -> Sample:
        return select_lead(self._selector, scan, self._motion)


def read_can_streams(
    path: Path, host: HostSignals | None
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a recorded log, and what is to be said of it. Raises UserError."""
    drive = CanDrive(host)
    streams: dict[str, list[Sample]] = {RADAR: [], ACCELERATION: [], HOST_SPEED: []}
    console = Console(stderr=True)
    size = max(path.stat().st_size, 1)
    frames = 0
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        # Only of text the position is known.
        known = size if path.suffix.lower() == ".log" else None
        task = progress.add_task(f"reading {path.name}", total=known)

        def at(position: int) -> None:
            progress.update(task, completed=position)

        for frame in read_frames(path, drive.counts, at):
            frames += 1
            for sample in drive.push(frame):
                streams[sample.input].append(sample)
    for sample in drive.flush():
        streams[sample.input].append(sample)
    if not frames:
        raise UserError(f"{path}: holds no CAN frame; a candump log, ASC or BLF file is expected")
    return streams, [f"{count} {what}" for what, count in drive.counts.items() if count]


def read_frames(path: Path, counts: Counter[str], at: Callable[[int], None]) -> Iterator[Frame]:
    """The data frames of a log, in its order; damaged lines are counted.

    `at` is told the position in the file now and then. Raises UserError for an unreadable file.
    """
    import can

    try:
        if path.suffix.lower() == ".log":
            with path.open("rb") as file:
                yield from _frames(_candump(file, counts, at), counts)
        else:
            reader = can.BLFReader if path.suffix.lower() == ".blf" else can.ASCReader
            with reader(path) as messages:  # type: ignore[arg-type]
                yield from _frames(_until_cut(messages, counts), counts)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error})") from error
    except Exception as error:
        # A reader that cannot even begin: a file of another kind.
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise UserError(
            f"{path}: cannot be read as a CAN log ({detail}); a candump log, ASC or BLF file is "
            "expected"
        ) from error


def _candump(file: Any, counts: Counter[str], at: Callable[[int], None]) -> Iterator["can.Message"]:
    """Messages of a candump log; a line that cannot be parsed is counted, and the next one read."""
    import can

    lines = _Lines(file, at)
    while not lines.ended:
        reader = can.CanutilsLogReader(lines)  # type: ignore[arg-type]
        messages = iter(reader)
        while True:
            try:
                message = next(messages)
            except StopIteration:
                break
            except Exception:  # whatever a damaged line makes the parser raise
                counts["damaged lines"] += 1
                break
            yield message


class _Lines:
    """Lines of an open file as text, which more than one reader can go on reading."""

    def __init__(self, file: Any, at: Callable[[int], None]) -> None:
        self._file, self._at = file, at
        self._read = self._shown = 0
        self.ended = False

    def __iter__(self) -> "_Lines":
        return self

    def __next__(self) -> str:
        line = self._file.readline()
        if not line:
            self.ended = True
            raise StopIteration
        self._read += len(line)
        if self._read - self._shown > 1_000_000:
            self._shown = self._read
            self._at(self._read)
        return line.decode("ascii", "replace")

    def read(self) -> str:
        """What makes this a file to its reader, which asks for lines only."""
        raise NotImplementedError

    def close(self) -> None:
        """The file is closed by who opened it."""


def _until_cut(messages: Iterable["can.Message"], counts: Counter[str]) -> Iterator["can.Message"]:
    """Messages up to where a file is cut off."""
    iterator = iter(messages)
    first = True
    while True:
        try:
            message = next(iterator)
        except StopIteration:
            return
        except Exception:
            if first:
                raise
            counts["places where the file is cut off"] += 1
            return
        first = False
        yield message


def _frames(messages: Iterable["can.Message"], counts: Counter[str]) -> Iterator[Frame]:
    for message in messages:
        if message.is_error_frame or message.is_remote_frame:
            counts["error and remote frames"] += 1
            continue
        if not abs(message.timestamp) < LATEST:
            counts["frames without a possible stamp"] += 1
            continue
        yield round(message.timestamp * 1e9), message.arbitration_id, bytes(message.data)
