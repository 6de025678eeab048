"""Cells of the tables of a page."""


def cells(text):
    """The cells of every row of every table, by its first one."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {line[0]: line[1:] for line in lines}
