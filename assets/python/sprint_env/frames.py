"""Pictures on their way: as raw bytes or as PNG, in base64."""

from __future__ import annotations

import base64
import struct
import zlib

from .environment import Frame

FORMATS = ("png", "raw")
#: Base64 of so many bytes is read faster than they are compressed.
RAW_UP_TO = 64 * 1024


def formats_of(size: tuple[int, int] | None) -> list[str]:
    """The formats of an environment's frames, the one that suits their size first."""
    if size is not None and 3 * size[0] * size[1] <= RAW_UP_TO:
        return ["raw", "png"]
    return ["png", "raw"]


def encode(frame: Frame, encoding: str) -> str:
    """A frame as the protocol has it, as JSON."""
    data = png(frame) if encoding == "png" else frame.rgb
    text = base64.b64encode(data).decode("ascii")
    return f'{{"encoding": "{encoding}", "width": {frame.width}, "height": {frame.height}, "data": "{text}"}}'


def png(frame: Frame) -> bytes:
    """A PNG file, compressed little: it travels between two processes, seldom further."""
    stride = 3 * frame.width
    # Each row is stored as its difference to the row above: flat areas become zeros.
    rows, above = bytearray(), bytes(stride)
    for y in range(frame.height):
        row = frame.rgb[y * stride : (y + 1) * stride]
        if row == above:
            rows += b"\2" + bytes(stride)
        else:
            rows += b"\0" + row
        above = row
    header = struct.pack(">IIBBBBB", frame.width, frame.height, 8, 2, 0, 0, 0)
    parts = [(b"IHDR", header), (b"IDAT", zlib.compress(rows, 1)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
