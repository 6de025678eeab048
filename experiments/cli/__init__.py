"""What every command shares: flags, words, the end of a process."""
