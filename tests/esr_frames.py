"""An encoder of ESR frames, written from the sensor's table and not from the project's DBC."""

TRACK = {
    # signal: (start bit, length, factor, signed)
    "ONCOMING": (0, 1, 1, False),
    "GROUPING_CHANGED": (1, 1, 1, False),
    "LAT_RATE": (7, 6, 0.25, True),
    "STATUS": (15, 3, 1, False),
    "ANGLE": (12, 10, 0.1, True),
    "RANGE": (18, 11, 0.1, False),
    "BRIDGE_OBJECT": (39, 1, 1, False),
    "ROLLING_COUNT": (38, 1, 1, False),
    "WIDTH": (37, 4, 0.5, False),
    "RANGE_ACCEL": (33, 10, 0.05, True),
    "MED_RANGE_MODE": (55, 2, 1, False),
    "RANGE_RATE": (53, 14, 0.01, True),
}
STATUS_1 = {"COMM_ERROR": (14, 1, 1, False), "SCAN_INDEX": (31, 16, 1, False)}
STATUS_2 = {
    "OVERHEAT_ERROR": (15, 1, 1, False),
    "RANGE_PERF_ERROR": (14, 1, 1, False),
    "INTERNAL_ERROR": (13, 1, 1, False),
    "XCVR_OPERATIONAL": (12, 1, 1, False),
    "TEMPERATURE": (31, 8, 1, True),
}
STATUS_4 = {
    "PATH_ID_ACC_MOVE": (15, 8, 1, False),
    "PARTIAL_BLOCKAGE": (4, 1, 1, False),
    "SIDELOBE_BLOCKAGE": (5, 1, 1, False),
}


def encode(layout: dict, **values: float) -> bytes:
    """Eight bytes: a signal's first bit is its highest one, and bits go down, then to the next."""
    data = bytearray(8)
    for name, value in values.items():
        start, length, factor, signed = layout[name]
        raw = round(value / factor)
        low, high = (
            (-(1 << (length - 1)), (1 << (length - 1)) - 1) if signed else (0, (1 << length) - 1)
        )
        assert low <= raw <= high, f"{name} {value} does not fit"
        byte, bit = divmod(start, 8)
        for position in reversed(range(length)):
            if raw >> position & 1:
                data[byte] |= 1 << bit
            bit -= 1
            if bit < 0:
                byte, bit = byte + 1, 7
    return bytes(data)


def track_frame(number: int, **values: float) -> tuple[int, bytes]:
    """Identifier and data of track 1 to 64."""
    return 0x500 + number - 1, encode(TRACK, **values)


def candump(frames: list[tuple[float, int, bytes]]) -> str:
    """A candump log of (time in s, identifier, data)."""
    return "".join(f"({t:.6f}) can0 {i:03X}#{data.hex().upper()}\n" for t, i, data in frames)


def scan_frames(
    time: float, scan: int, tracks: dict[int, dict[str, float]], last: int = 64
) -> list[tuple[float, int, bytes]]:
    """All track frames of one scan, empty ones included, a quarter of a millisecond apart."""
    frames = []
    for number in range(1, last + 1):
        values = {"STATUS": 0, "ROLLING_COUNT": scan % 2, **tracks.get(number, {})}
        frames.append((time + number * 0.00023, *track_frame(number, **values)))
    return frames
