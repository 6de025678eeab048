"""Train agents to carry out tasks written in temporal logic, end to end in JAX (after T2TL, RA-L 2023)."""
