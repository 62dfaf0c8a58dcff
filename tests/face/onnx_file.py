"""A people "network" small enough to write by hand: ONNX is protobuf, and protobuf is numbers and lengths.

It averages 32 x 32 px cells of a 640 x 640 image and calls every dark cell a person, in a box around the cell; its
output is laid out as YOLOv8's: (1, 5, 400).
"""

import numpy as np
from numpy.typing import NDArray

SIZE, CELL = 640, 32
_FLOAT, _INT64 = 1, 7
_INTS, _INT = 7, 2


def _varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def _field(number: int, value: int | str | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, array: NDArray[np.float32] | NDArray[np.int64]) -> bytes:
    kind = _FLOAT if array.dtype == np.float32 else _INT64
    dims = b"".join(_field(1, side) for side in array.shape)
    return dims + _field(2, kind) + _field(8, name) + _field(9, array.tobytes())


def _ints(name: str, values: list[int]) -> bytes:
    return _field(5, _field(1, name) + b"".join(_field(8, value) for value in values) + _field(20, _INTS))


def _int(name: str, value: int) -> bytes:
    return _field(5, _field(1, name) + _field(3, value) + _field(20, _INT))


def _node(kind: str, inputs: list[str], output: str, attributes: bytes = b"") -> bytes:
    names = b"".join(_field(1, name) for name in inputs)
    return _field(1, names + _field(2, output) + _field(3, output) + _field(4, kind) + attributes)


def _value(name: str, shape: tuple[int, ...]) -> bytes:
    dims = b"".join(_field(1, _field(1, side)) for side in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, _FLOAT) + _field(2, dims)))


def dark_cells() -> bytes:
    cells = SIZE // CELL
    weights = np.full((1, 3, CELL, CELL), -2.2 / (3 * CELL * CELL), np.float32)
    bias = np.ones(1, np.float32)
    row, column = np.divmod(np.arange(cells * cells), cells)
    boxes = np.stack([(column + 0.5) * CELL, (row + 0.5) * CELL, np.full(400, CELL), np.full(400, 2 * CELL)])
    graph = (
        _node(
            "Conv",
            ["image", "weights", "bias"],
            "darkness",
            _ints("kernel_shape", [CELL, CELL]) + _ints("strides", [CELL, CELL]),
        )
        + _node("Reshape", ["darkness", "shape"], "scores")
        + _node("Concat", ["boxes", "scores"], "people", _int("axis", 1))
        + _field(2, "dark_cells")
        + _field(5, _tensor("weights", weights))
        + _field(5, _tensor("bias", bias))
        + _field(5, _tensor("shape", np.array([1, 1, 400], np.int64)))
        + _field(5, _tensor("boxes", boxes[None].astype(np.float32)))
        + _field(11, _value("image", (1, 3, SIZE, SIZE)))
        + _field(12, _value("people", (1, 5, 400)))
    )
    opset = _field(1, "") + _field(2, 13)
    return _field(1, 8) + _field(7, graph) + _field(8, opset)
