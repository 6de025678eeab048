"""A function of a few small arrays as straight-line arithmetic on single numbers.

Physics engines are written for robots of any size: vectors and matrices, searches, factorisations. Of a small robot
most of it is known before it runs (entries that are 0 or 1, axes that never turn), and the rest is many tiny arrays,
each of which costs a pass through memory, and on a GPU a kernel. Here a function is traced once, its arrays are taken
apart into their entries, what is known is computed at once and what is the same only once. What is left is one long
expression, which the compiler keeps in registers.

The arithmetic is the function's. Three things can differ in rounding, or where numbers are not finite: sums are added
up from the first to the last, or along a row as `layout` and the compiler have it; triangular systems are solved row by
row; and a known 0 times anything is 0.
"""

from envs.straight_line.program import straight_line

__all__ = ["straight_line"]
