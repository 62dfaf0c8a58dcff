"""The compiled detector. Use `limo_hog.HOGDescriptor` or `limo_hog.PeopleDetector`; this is what they call."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

_Pair: TypeAlias = tuple[int, int]

class Hog:
    """A geometry with or without an SVM: immutable, shareable between threads; calls release the GIL.

    Sizes, strides and paddings are (x, y) [px]; the stride (0, 0) stands for a method's default. Images are uint8,
    (H, W), (H, W, 1) or (H, W, 3). Raises the `HogError` family of `limo_hog.exceptions`.
    """

    def __new__(
        cls,
        win_size: _Pair,
        block_size: _Pair,
        block_stride: _Pair,
        cell_size: _Pair,
        nbins: int,
        win_sigma: float,
        l2_hys_threshold: float,
        gamma_correction: bool,
        nlevels: int,
        signed_gradient: bool,
        detector: NDArray[np.float32] | None,
    ) -> Self: ...
    @property
    def descriptor_len(self) -> int: ...
    def gradient(
        self, image: NDArray[np.uint8], padding: tuple[int, int, int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]: ...
    def compute(
        self, image: NDArray[np.uint8], win_stride: _Pair, padding: _Pair, locations: Sequence[_Pair] | None
    ) -> NDArray[np.float32]: ...
    def detect(
        self,
        image: NDArray[np.uint8],
        hit_threshold: float,
        win_stride: _Pair,
        padding: _Pair,
        locations: Sequence[_Pair] | None,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...
    def detect_multi_scale(
        self,
        image: NDArray[np.uint8],
        hit_threshold: float,
        win_stride: _Pair,
        padding: _Pair,
        scale: float,
        group_threshold: float,
        mean_shift: bool,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...

def group_rectangles(
    rects: Sequence[Sequence[int]], threshold: int, eps: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]: ...
def default_people_detector() -> NDArray[np.float32]: ...
def daimler_people_detector() -> NDArray[np.float32]: ...
def set_num_threads(count: int) -> None: ...
def get_num_threads() -> int: ...
def backend() -> str: ...
def available_backends() -> list[str]: ...
