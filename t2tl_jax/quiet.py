"""Keep the output to what was asked for: MuJoCo prints two lines when it is imported without its optional `warp`."""

import contextlib
import io
from collections.abc import Iterator

NOISE = ("Failed to import warp", "Failed to import mujoco_warp")


@contextlib.contextmanager
def quiet_imports() -> Iterator[None]:
    """Drop those lines inside the block; whatever else is printed there appears at its end."""
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard):
            yield
    finally:
        for line in heard.getvalue().splitlines():
            if not line.startswith(NOISE):
                print(line)
