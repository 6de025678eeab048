"""From formulas and reward machines to finite automata, in plain Python and NumPy.

`automaton.build` goes through the files in this order: `normal_form` (negations down to the propositions), `core`
(formulas as numbers), `states` (progression; `diagrams` say which state follows each letter), `minimise` (verdicts,
merging) and `display` (the formula that a row shows), all over an `alphabet` and within a `budget`. What comes out are
`steps`, the diagrams as arrays, never a list of all letters; `parts` writes them as arrays in which letters are looked
up, and `forest` joins those of many automata. `machine_automaton.build_machines` does the same for reward machines,
where nothing has to be searched. `cubes` puts sets of letters into words.
"""
