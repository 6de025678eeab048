"""Types shared by the network modules."""

from collections.abc import Callable
from typing import Any

Initializer = Callable[..., Any]  # (key, shape, dtype) -> array
