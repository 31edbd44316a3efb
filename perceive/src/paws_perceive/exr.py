"""OpenEXR, one channel of 32-bit floats, not packed: what `paws import` reads depth from, and what the cache holds."""

import struct

import numpy as np


def encoded(values):
    """The bytes of a file whose channel Y holds `values` (rows x columns)."""
    values = np.ascontiguousarray(values, dtype="<f4")
    rows, columns = values.shape
    box = struct.pack("<4i", 0, 0, columns - 1, rows - 1)

    def attribute(name, kind, data):
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data

    # One channel: its name, 32-bit float, not linear, every pixel.
    channel = b"Y\0" + struct.pack("<iB3xii", 2, 0, 1, 1) + b"\0"
    head = struct.pack("<ii", 20000630, 2)
    for part in (
        (b"channels", b"chlist", channel),
        (b"compression", b"compression", b"\0"),
        (b"dataWindow", b"box2i", box),
        (b"displayWindow", b"box2i", box),
        (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1.0)),
        (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0.0, 0.0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1.0)),
    ):
        head += attribute(*part)
    head += b"\0"
    # Offsets of the rows, then each row: its number, its length, its values.
    first, length = len(head) + 8 * rows, 8 + 4 * columns
    offsets = struct.pack(f"<{rows}Q", *(first + length * row for row in range(rows)))
    lines = b"".join(struct.pack("<ii", row, 4 * columns) + values[row].tobytes() for row in range(rows))
    return head + offsets + lines


def decoded(data):
    """The values of a file as `encoded` writes it, or `None` where it is not whole."""
    window, last = b"dataWindow\0box2i\0", b"screenWindowWidth\0float\0"
    try:
        _, _, right, bottom = struct.unpack_from("<4i", data, data.index(window) + len(window) + 4)
        # Behind the last attribute: its length and value, and the end of the head.
        table = data.index(last) + len(last) + 4 + 4 + 1
        rows, columns = bottom + 1, right + 1
        offsets = np.frombuffer(data, "<u8", rows, table)
        return np.stack([np.frombuffer(data, "<f4", columns, int(offset) + 8) for offset in offsets])
    except (ValueError, struct.error):
        return None
