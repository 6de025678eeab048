"""Somebody else's package: everything that can be registered, through the public functions alone.

`--import somebody` makes the command line know all of it.
"""

from somebody import configs, encoder, family, learner, world  # noqa: F401
