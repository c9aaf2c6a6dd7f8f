"""Frames of a Delphi ESR become scans: tracks 0x500 to 0x53F and statuses 1, 2 and 4.

The layout is in `dbc/esr.dbc`; it is decoded by cantools. The texts of the statuses are from the
sensor's published descriptions.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.resources import files
from math import cos, isfinite, nan, radians, sin
from typing import TYPE_CHECKING, Any

from lfd_mpc.samples import RadarSample
from lfd_replay.recordings.lead_selection import HostMotion, LeadSelector, Track

if TYPE_CHECKING:
    from cantools.database import Database

FIRST_TRACK, TRACKS = 0x500, 64
STATUS_4 = 0x4E3

FRAME_BYTES = 8

EMPTY = 0
NOT_MEASURED = {4: "coasted", 6: "invalid coasted", 7: "new coasted"}
"""STATUS of a track: 0 is no target; these are predictions of the radar's own, not measurements."""

SCAN_GAP_NS = 30_000_000
"""Tracks further apart belong to two scans."""

STUCK = 4
"""Scans with the same rolling count after which a frame is taken for a repeated old one."""

FLAGS = {
    "COMM_ERROR": (1, "communication error", 1),
    "OVERHEAT_ERROR": (2, "overheated", 1),
    "RANGE_PERF_ERROR": (4, "range performance error", 1),
    "INTERNAL_ERROR": (8, "internal error", 1),
    "XCVR_OPERATIONAL": (16, "transceiver not operational", 0),
    "PARTIAL_BLOCKAGE": (32, "partial blockage", 1),
    "SIDELOBE_BLOCKAGE": (64, "sidelobe blockage", 1),
}
"""By signal of a status frame: our bit, its text, and the value that is a complaint."""


@cache
def database() -> "Database":
    """The project's own description of the frames."""
    # Not every drive is CAN, and every start would wait for it.
    from cantools.database import Database, load_string

    text = (files("lfd_replay.recordings") / "dbc" / "esr.dbc").read_text()
    database = load_string(text, "dbc")
    assert isinstance(database, Database)
    return database


@dataclass(frozen=True)
class Scan:
    """One scan at `stamp` (ns): its tracks, and the number of the one in path.

    `in_path`: 0 = none, None = the radar does not say. `flags` is what the radar says of itself,
    as in `FLAGS`, and `text` the same in words.
    """

    stamp: int
    tracks: tuple[Track, ...]
    in_path: int | None = None
    flags: int = 0
    text: str = ""


def esr_track(number: int, status: int, distance: float, angle: float, rate: float) -> Track | None:
    """A track of the ESR, or None for an empty one.

    `distance` in m along the beam, `angle` in degrees, positive to the right, `rate` in m/s along
    the beam: taken as it is, since over the width of a lane it differs by less than its steps.
    """
    if status == EMPTY:
        return None
    # Nobody knows the cosine of infinity; the selector leaves out what is no number.
    beam = radians(angle) if isfinite(angle) else nan
    measured = status not in NOT_MEASURED
    return Track(number, distance * cos(beam), -distance * sin(beam), rate, measured)


class ScanAssembler:
    """Tracks of one radar, one after the other, become scans."""

    def __init__(self, counts: Counter[str]) -> None:
        """`counts` is where damage is noted."""
        self._counts = counts
        self._tracks: list[Track] = []
        self._last: tuple[int, int] | None = None
        self._rolling: dict[int, tuple[int, int]] = {}
        self._rolls = False
        self.in_path: int | None = None

    def push(self, stamp: int, number: int, track: Track | None, rolling: int) -> Iterator[Scan]:
        """Take track `number` (1 to 64), received at `stamp` (ns); None = it is empty.

        Gives the scans that it completes; `rolling` is its rolling count.
        """
        if self._last is not None:
            before, last = self._last
            if number <= last or not 0 <= stamp - before <= SCAN_GAP_NS:
                self._counts["scans without their last track"] += 1
                yield self._finish()
        self._last = stamp, number
        if track is not None and not self._count_roll(number, rolling):
            self._tracks.append(track)
        if number == TRACKS:
            yield self._finish()

    def flush(self) -> Iterator[Scan]:
        """The scan that the end of a recording has cut off."""
        if self._last is not None:
            yield self._finish()

    def _count_roll(self, number: int, rolling: int) -> bool:
        """Take note of a track's rolling count; whether the track repeats itself.

        A radar that never counts is taken as it is.
        """
        last, same = self._rolling.get(number, (-1, 0))
        same = same + 1 if rolling == last else 1
        self._rolls |= last >= 0 and rolling != last
        self._rolling[number] = rolling, same
        stuck = self._rolls and same >= STUCK
        self._counts["tracks with a stuck rolling count"] += stuck
        return stuck

    def _finish(self) -> Scan:
        """Close the scan: its stamp is that of its last track, when all of it is known."""
        assert self._last is not None
        scan = Scan(self._last[0], tuple(self._tracks), self.in_path)
        self._tracks, self._last = [], None
        return scan


class EsrDecoder:
    """Frame after frame in, scan after scan out; what is damaged is counted, nothing else lost."""

    def __init__(self) -> None:
        self._status: dict[str, int] = {}
        self.counts: Counter[str] = Counter()
        self._assembler = ScanAssembler(self.counts)

    @cached_property
    def _messages(self) -> dict[int, Any]:
        return {message.frame_id: message for message in database().messages}

    def push(self, stamp: int, identifier: int, data: bytes) -> Iterator[Scan]:
        """Take one frame received at `stamp` (ns); gives the scans that it completes."""
        message = self._messages.get(identifier)
        if message is None:
            self.counts["frames of unknown identifiers"] += 1
            return
        if len(data) != FRAME_BYTES:
            self.counts["ESR frames of a wrong length"] += 1
            return
        values: Any = message.decode(data, decode_choices=False)
        if FIRST_TRACK <= identifier < FIRST_TRACK + TRACKS:
            number = identifier - FIRST_TRACK + 1
            track = esr_track(
                number, values["STATUS"], values["RANGE"], values["ANGLE"], values["RANGE_RATE"]
            )
            scans = self._assembler.push(stamp, number, track, values["ROLLING_COUNT"])
            yield from map(self._with_complaints, scans)
            return
        self._status.update({name: values[name] for name in FLAGS if name in values})
        if identifier == STATUS_4:
            self._assembler.in_path = int(values["PATH_ID_ACC_MOVE"])

    def flush(self) -> Iterator[Scan]:
        """The scan that the end of a recording has cut off."""
        yield from map(self._with_complaints, self._assembler.flush())

    def _with_complaints(self, scan: Scan) -> Scan:
        raised = [
            (bit, text)
            for name, (bit, text, bad) in FLAGS.items()
            if self._status.get(name, 1 - bad) == bad
        ]
        flags = sum(bit for bit, _ in raised)
        return replace(scan, flags=flags, text=", ".join(text for _, text in raised))


def select_lead(selector: LeadSelector, scan: Scan, host: HostMotion) -> RadarSample:
    """The lead of a scan, with what the radar says of itself."""
    lead = selector.select(scan.stamp, scan.tracks, host.speed, host.yaw_rate, scan.in_path)
    return replace(lead, sensor_flags=scan.flags, sensor_text=scan.text)
