"""From formulas and reward machines to finite automata, in plain Python and NumPy.

`automaton.build` goes through the files in this order: `normal_form` (negations down to the propositions), `core`
(formulas as numbers), `states` (progression; `diagrams` say which state follows each letter), `minimise` (verdicts,
merging) and `display` (the formula that a row shows), all over an `alphabet` and within a `budget`.
`machine_automaton.build_machines` writes out reward machines, where nothing has to be searched. `cubes` puts sets of
letters into words.
"""
