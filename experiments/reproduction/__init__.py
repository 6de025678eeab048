"""Everything that the paper shows, measured again: which runs, which tables, and the command that makes them."""
