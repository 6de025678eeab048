"""Reward machines as text: the format and its errors, names, files and the command line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from t2tl_jax.ltl import (
    REWARD_MACHINES,
    TRUE,
    WATER_PROPOSITIONS,
    Formula,
    LTLError,
    MachineSyntaxError,
    RewardMachine,
    Transition,
    UnknownPropositionError,
    UnknownTaskError,
    compile_named,
    compile_reward_machines,
    named_machines,
    named_task,
    parse,
    parse_machine,
    prop,
    read_machine,
    resolve_task,
)
from t2tl_jax.ltl.__main__ import main

ABCDEF = tuple("abcdef")

# ----- the format -----

NAME = st.sampled_from(["a", "Gray", "light on", 'say "hi"', "and/or", "a # b", "/ 1", "->", "é", "F"])
GUARD = st.recursive(
    st.builds(prop, NAME) | st.sampled_from([TRUE, Formula("False")]),
    lambda inner: (
        st.builds(lambda x: ~x, inner)
        | st.builds(
            lambda op, x, y: Formula(op, (x, y)), st.sampled_from(["and", "or", "implies", "iff"]), inner, inner
        )
    ),
    max_leaves=6,
)
REWARD = st.sampled_from([0.0, 1.0, -1.0, 0.1, 1e-7, 12345.678])


@st.composite
def machines(draw):
    states = draw(st.lists(st.sampled_from(["1", "u2", "A", "_", "F"]), min_size=1, max_size=4, unique=True))
    transitions = []
    for state in states:
        guards = draw(st.lists(GUARD.filter(lambda guard: guard != TRUE), min_size=1, max_size=3))
        for guard in guards:
            transitions.append(Transition(state, draw(st.sampled_from([*states, "done", "fail"])), guard, draw(REWARD)))
    otherwise = draw(st.sampled_from([*states, "stay", "done", "fail"]))
    return RewardMachine("machine", draw(st.sampled_from(states)), otherwise, draw(REWARD), tuple(transitions))


@pytest.mark.slow
@given(machines())
def test_text_parses_back_to_an_equal_machine(machine):
    assert parse_machine(str(machine)) == machine


@pytest.mark.parametrize("name", [name for name in REWARD_MACHINES if len(REWARD_MACHINES[name]) == 1])
def test_shipped_machines_print_and_parse_back(name):
    (machine,) = named_machines(name)
    assert parse_machine(str(machine), machine.name) == machine


@given(st.text(alphabet='s1ab->:/#"\\ .\n', max_size=40))
def test_any_text_is_read_or_refused_cleanly(text):
    text = f"start -> s\notherwise -> stay\ns -> s : a\n{text}"
    try:
        machine = parse_machine(text)
        assert parse_machine(str(machine)) == machine
    except MachineSyntaxError as error:
        assert error.line >= 1 and "^" in str(error)


def test_spacing_comments_spellings_and_order():
    machine = parse_machine(
        "\n# a comment\n  otherwise->fail/ -0.5 # another\r\nstart  ->  s\n"
        's->s:"a # b" /\\ ~b/1e1\n\n\tt -> done : c\\/d\ns -> t : a -> b\n'
    )
    assert machine.states == ("s", "t") and machine.start == "s"
    assert (machine.otherwise, machine.otherwise_reward) == ("fail", -0.5)
    assert [(t.guard, t.reward) for t in machine.lines_of("s")] == [
        (parse('"a # b" & !b'), 10.0),
        (parse("a -> b", co_safe=False), 0.0),
    ]
    assert machine.lines_of("t")[0].guard == parse("c | d")


def test_the_first_line_that_holds_is_taken():
    machine = parse_machine("start -> 1\notherwise -> 2 / 5\n1 -> 2 : a & b / 1\n1 -> 1 : a / 2\n2 -> 2 : b / 3")
    steps = {"": ("2", 5.0), "a": ("1", 2.0), "b": ("2", 5.0), "ab": ("2", 1.0), "abz": ("2", 1.0)}
    assert {letters: machine.step("1", letters) for letters in steps} == steps
    assert machine.step("done", "ab") == ("done", 0.0)
    with pytest.raises(LTLError, match='no state "3"; known: 1, 2'):
        machine.step("3", "")


def with_line(line):
    return f"start -> one\notherwise -> stay\none -> done : a\n{line}"


@pytest.mark.parametrize(
    ("text", "problem", "line", "column"),
    [
        (with_line("one -> two : b"), 'no line leads from "two".*\n.*\n.*\nexpected one of one, done, fail', 4, 7),
        (with_line("one -> onne : b"), 'did you mean "one"', 4, 7),
        (with_line("one -> stay : b"), 'no line leads from "stay"', 4, 7),
        (with_line("one one : b"), "cannot read 'o'", 4, 4),
        (with_line("one -> : b"), "cannot read ':'", 4, 7),
        (with_line("one -> one"), "line ends here(.|\n)*expected : and a guard", 4, 10),
        (with_line("one -> one : "), "formula is empty", 4, 13),
        (with_line("one -> one : a & & b"), "'&' stands where an operand belongs", 4, 17),
        (with_line("one -> one : (a | b"), "never closed", 4, 13),
        (with_line('one -> one : "a'), "never closed", 4, 13),
        (with_line("one -> one : a & F b"), "'F' speaks of later steps", 4, 17),
        (with_line("one -> one : a U b / 1"), "'U' speaks of later steps", 4, 15),
        (with_line("one -> one : a / much"), "'much' is no number", 4, 17),
        (with_line("one -> one : a /"), "'' is no number", 4, 16),
        (with_line("one -> one : a / nan"), "'nan' is no number", 4, 17),
        (with_line("one -> one : a / 1e99"), "no number between", 4, 17),
        (with_line("one -> one : a / 1 2"), "cannot read '/'", 4, 15),
        (with_line("done -> one : a"), "the task is over there", 4, 0),
        (with_line("stay -> one : a"), "the word is reserved", 4, 0),
        (with_line("start -> one"), "a second line", 4, 0),
        (with_line("? -> one : a"), r"cannot read '\?'", 4, 0),
        (with_line("one -> one : true\none -> done : b"), "never reached: an earlier line of state one", 5, 0),
        ("start -> one : a", "':' follows a complete line", 1, 13),
        ("start -> done\notherwise -> stay\none -> one : a", 'no line leads from "done"', 1, 9),
        ("otherwise -> stay\none -> one : a", 'the line "start -> ..." is missing', 2, 14),
        ("start -> one\none -> one : a", 'the line "otherwise -> ..." is missing', 2, 14),
        ("start -> one\notherwise -> nowhere\none -> one : a", "expected one of one, stay, done, fail", 2, 13),
        ("", 'the line "start -> ..." is missing', 1, 0),
    ],
)
def test_errors_show_line_and_place(text, problem, line, column):
    with pytest.raises(MachineSyntaxError, match=problem) as caught:
        parse_machine(text, "mine")
    message = str(caught.value).splitlines()
    assert message[0].startswith(f"mine, line {line}: ") and caught.value.line == line
    assert message[1] == f"  {text.splitlines()[line - 1] if text else ''}"
    assert message[2] == " " * (2 + column) + "^"


def test_unknown_proposition_shows_the_place_and_the_nearest():
    machine = parse_machine("start -> 1\notherwise -> stay\n1 -> done : !Red & Yelow / 1", "mine")
    with pytest.raises(UnknownPropositionError) as caught:
        compile_reward_machines(machine, ("Red", "Yellow"))
    assert str(caught.value).splitlines() == [
        'mine: unknown proposition "Yelow"; known: Red, Yellow; did you mean "Yellow"?',
        "  1 -> done : !Red & Yelow / 1",
        "                     ^",
    ]
    by_hand = RewardMachine("mine", "1", "stay", 0.0, (Transition("1", "done", prop("x")),))
    with pytest.raises(UnknownPropositionError, match="1 -> done : x"):
        compile_reward_machines(by_hand, ("y",))


# ----- names -----


def test_a_machine_built_by_hand_is_checked():
    line = Transition("1", "done", prop("x"))
    for start, otherwise, lines in [("2", "stay", [line]), ("1", "never", [line]), ("1", "stay", [])]:
        with pytest.raises(LTLError, match=r"by hand: .* is none of its states"):
            RewardMachine("by hand", start, otherwise, 0.0, tuple(lines))
    with pytest.raises(LTLError, match=r'"2" is none of its states: 1$'):
        RewardMachine("by hand", "1", "stay", 0.0, (Transition("1", "2", prop("x")),))


def test_every_name_resolves():
    for name, stems in REWARD_MACHINES.items():
        machines = named_machines(name)
        assert tuple(machine.name for machine in machines) == stems
        table = compile_named(f" {name} ", WATER_PROPOSITIONS if "phi" in name else ABCDEF, length=12)
        assert table.num_tasks == len(stems) and table.tokens.shape[1] == 12
    assert named_machines("rm_water") == tuple(named_machines(f"rm_t{k}")[0] for k in range(1, 11))


def test_named_formulas_texts_and_files(tmp_path):
    assert compile_named("phi_water", WATER_PROPOSITIONS).formula(2) == named_task("phi_water")
    assert compile_named("F(a & F b)", ABCDEF, "at_most_one", length=9).tokens.shape == (4, 9)
    path = tmp_path / "mine.rm"
    path.write_text("start -> 1\notherwise -> stay\n1 -> done : a / 1\n")
    assert compile_named(str(path), ABCDEF).states == ("done", "fail", "mine.1")
    path.write_text("start 1")
    with pytest.raises(MachineSyntaxError, match="mine, line 1"):
        read_machine(path)
    path.write_bytes(b"\xff")
    for wrong in (path, tmp_path / "none.rm", tmp_path):
        with pytest.raises(UnknownTaskError, match="cannot read the reward machine"):
            read_machine(wrong)


def test_misspelt_names():
    with pytest.raises(UnknownTaskError, match=r'did you mean "rm_water"\?'):
        compile_named("rm_watr", ABCDEF)
    with pytest.raises(UnknownTaskError, match=r'did you mean "phi_water"\?'):
        compile_named("phi_watr", ABCDEF)
    with pytest.raises(LTLError, match="reward machine, not a formula"):
        resolve_task("rm_t1")


def test_command_line(capsys):
    assert main(["rm_t1", "rm_t2", "--word", "a;b"]) == 0
    out = capsys.readouterr().out
    assert "6 rows, 2 tasks, 16 letters (every_subset of a, b, c, d)" in out and "2 {b}                 true" in out
    assert main(["rm_t1", "--dot"]) == 0
    assert '2 -> 0 [label="b / 1"];' in capsys.readouterr().out
    assert main(["rm_t1", "F a"]) == 2
    assert "cannot share a table" in capsys.readouterr().err
