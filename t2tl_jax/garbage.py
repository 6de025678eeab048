"""Python's search for garbage, put off where it takes long and finds next to none.

Loading modules and tracing make hundreds of thousands of objects that stay. Each time that their number has grown by a
quarter, Python looks through all of them.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def garbage_kept() -> Iterator[None]:
    """Look for none inside of the block, and afterwards again if it was so before.

    Blocks may lie within each other, and beside each other in threads: at the latest when all of them have ended,
    garbage is looked for again, since the first of them knows that it was before.
    """
    looked = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looked:
            gc.enable()
