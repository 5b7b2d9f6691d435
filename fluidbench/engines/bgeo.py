"""Particle files for engines that read Houdini's old binary geometry (BGEO, version 5), through Partio."""

import struct
from pathlib import Path

import numpy as np

from ..files import write_atomically

VECTOR = 5  # code of an attribute of three floats


def write_bgeo(path: Path, position: np.ndarray, velocity: np.ndarray) -> None:
    """Positions [m] and velocities [m/s], each of shape (n, 3), as points in this order.

    Big-endian: magic, version, seven counts, the table of point attributes, then x y z w and the attributes a point.
    """
    counts = (len(position), 0, 0, 0, 1, 0, 0, 0)  # points, primitives, their groups, attributes of points, of the rest
    name = b"velocity"
    head = struct.pack(">4sci8i", b"Bgeo", b"V", 5, *counts)
    attribute = struct.pack(">H", len(name)) + name + struct.pack(">Hi3f", 3, VECTOR, 0.0, 0.0, 0.0)
    rows = np.hstack([position, np.ones((len(position), 1)), velocity]).astype(">f4")
    write_atomically(path, head + attribute + rows.tobytes() + b"\x00\xff")
