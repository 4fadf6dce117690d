"""How good a sample of a record is."""

import enum

import numpy as np

QualityArray = np.ndarray[tuple[int], np.dtype[np.uint8]]


class Quality(enum.IntEnum):
    """What is known of one sample, as one byte of a record's mask."""

    GOOD = 0  # measured
    HELD = 1
    """Missing in the source; carried over from its neighbours, or interpolated between them."""
    BAD = 2  # not to be used; its values may be NaN
    MANUAL = 3  # measured, but the loop was not in automatic

    @property
    def word(self) -> str:
        """The name in files: ``good``, ``held``, ``bad`` or ``manual``."""
        return self.name.lower()


QUALITY_WORDS = {quality.word: quality for quality in Quality}  # word in files to quality
USABLE = (Quality.GOOD, Quality.HELD)  # what identification works on
