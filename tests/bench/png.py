"""Reads and writes PNG, 8 bits per channel; a picture is a list of rows of bytes. Standard library only."""
import struct
import zlib


def read(path):
    """Returns (width, height, channels, rows of bytes)."""
    data, at, stored = path.read_bytes(), 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", data[at + 8:at + 18])
            channels = {0: 1, 2: 3, 6: 4}[color]
            assert depth == 8
        elif kind == b"IDAT":
            stored += data[at + 8:at + 8 + size]
        at += 12 + size
    raw, stride, rows, above = zlib.decompress(stored), width * channels, [], bytes(width * channels)
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride if kind else 0):
            left = line[i - channels] if i >= channels else 0
            corner = above[i - channels] if i >= channels else 0
            if kind == 4:
                guess = left + above[i] - corner
                far = [abs(guess - left), abs(guess - above[i]), abs(guess - corner)]
                predicted = (left, above[i], corner)[far.index(min(far))]
            else:
                predicted = (0, left, above[i], (left + above[i]) // 2)[kind]
            line[i] = (line[i] + predicted) & 255
        above = bytes(line)
        rows.append(above)
    return width, height, channels, rows


def write(path, width, rows):
    """Writes rows of RGB bytes."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    raw = b"".join(b"\0" + bytes(row) for row in rows)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, len(rows), 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))
