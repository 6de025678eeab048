"""A curve as a line of text. Apart from the pictures, since commands that draw none need not load matplotlib."""

import numpy as np


def sparkline(values: np.ndarray, width: int = 32) -> str:
    """A curve between 0 and 1 as a line of block characters; points without data are blank.

    Args:
        values: ``float[points]``, NaN where absent.
        width: at most this many characters; each is the mean of the points that it covers.
    """
    blocks = "▁▂▃▄▅▆▇█"
    text = ""
    for part in np.array_split(values, min(width, len(values)) or 1):
        known = part[np.isfinite(part)]
        level = int(np.clip(known.mean(), 0, 1) * (len(blocks) - 1) + 0.5) if known.size else -1
        text += blocks[level] if known.size else " "
    return text
