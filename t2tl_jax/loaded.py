"""When this package was first imported: sources that changed later are not what runs."""

import time

AT = time.time()
"""Seconds since the epoch."""
