"""What the words of the page of agents for any task mean, what was chosen on what, and whose the other figures are."""

from collections.abc import Mapping

from envs.zones import OPEN_6, OPEN_10
from experiments.paper import published_any as published
from experiments.reproduction.page import paragraph


def _listed(rates: Mapping[str, float], digits: int = 3) -> str:
    return ", ".join(f"{method} {rate:.{digits}f}" for method, rate in rates.items())


def other_worlds() -> str:
    """What newer methods report of worlds that resemble the open ZoneEnv, and why that does not compare."""
    means = {method: published.mean_of(list(of.values())) for method, of in published.KINEMATIC_NM.items()}
    rates = {method: mean.success for method, mean in means.items() if mean is not None and mean.success is not None}
    return paragraph(
        "**Newer methods, in other worlds.** The figures of StructLTL, SemLTL and Jaxolotl that we have are of a "
        "kinematic ZoneEnv, most of them of ZoneEnv-NM, where entering purple takes the green discs away. Success "
        "there, mean of z1 to z6, s7 and s8 in its colours, from result files of StructLTL's repository (10 seeds "
        f"with 512 episodes, sampled): {_listed(rates)}. A summary of Jaxolotl's paper "
        f"has for ZoneEnv-NM {_listed(published.JAXOLOTL_NM)}, and for its ZoneEnv without that rule "
        f"{_listed(published.JAXOLOTL_ZONES, 2)}; for which formulas, it does not say. Of PlatoLTL we have no figures. "
        "None of this was played by us, and ours was not played there. These figures do not compare with ours. "
        "The robot turns at once there, and goes up to 0.058 m in a step, ours 0.030 m: with the same limit of 1,000 "
        "steps it gets nearly twice as far. There is no compass and no sensor of the walls, leaving the arena ends the "
        "episode without a reward of -1, and discs that vanish make an early choice matter. So this page "
        "compares with none of these methods in that world; its tables compare with some of them in other worlds."
    )


TERMS = f"""\
## How to read the tables

- **Success**: the formula became true. **Violation**: it became false. **Ended by env**: the agent left the arena while
  the formula was open. **Steps**: means over the episodes that succeed.
- **Violation / ended by env / time-out**: these three in one cell, means over seeds and formulas. With success they
  add up to 1.
- **Return**: mean discounted reward, 1 when the formula becomes true, -1 for a violation and for leaving the arena.
  Others count 0 for these, so our convention can only lower our figure. (LTL2Action's in the walled ZoneEnv counts a
  violation as ours does.)
- **Policy**: sampled, unless said otherwise; its **mode** is the deterministic one.
- **Episodes**: 500 for each seed, formula and policy, on maps that are kept for evaluation. Three lines have fewer, for
  each seed and policy: 500 over all formulas of `Until_1_2_1_1`, 500 over those of an agent's own family, and 10 for
  each of 50 formulas with a map of its own. For these there are no results by formula.
- **Brackets**: 95 % intervals over seeds (of rates, Wilson's with one trial a seed). Of several formulas: over seeds
  and formulas, both as samples, by Student's t, which for a rate is widened to Wilson's over seeds. A cell whose
  interval would look empty has more digits.
- **Student's t**, in the tables of aims and in columns of that name: a second interval for a mean rate over seeds, by
  how far these lie apart; a dash where all are equal. Wilson's is wide, even [0.7, 1.0] for ten seeds that never fail,
  since it allows for seeds that fail altogether, which ten may miss by chance.
- **Aims** are judged by the mean itself. Where its interval by Student's t includes the bar, or a certificate lies
  below it, the verdict says so. An aim that names the worst formula is judged by the mean over seeds of that formula.
  One that names the worst seed and formula is judged by this single figure.
- **Read alone**: in a world of a single state an action is a proposition that becomes true, so that a task takes
  nothing but reading. Codes are trained and tested there; *beside the robot* is an agent with such a code in ZoneEnv.
- **Rows met**: of the formula's open rows, how many were a row of any pool of the training, by language. **Renamed**:
  also under other names of propositions. Of more than four colours, a row that reads more colours than the training had
  was not met. Its own family: all rows of the formulas that are kept for evaluation.
- **Six, eight and ten colours**: maps with so many. The formulas are the same three on all of them, six_1 to six_3,
  which speak of six colours: the others are only on the map. Discs have a radius of {OPEN_6.radius:.2f} m,
  with ten colours of {OPEN_10.radius:.2f} m.
- **Unseen**: a formula of which a row was met is not unseen in the strict sense. Its last steps, such as "reach Blue",
  are rows of nearly every task. The formulas of the tests themselves are kept out of all pools of the agents, under
  whatever names, but for those of more than four colours, of `Until_1_2_1_1` and of the lists with maps. What encoders
  met in their pre-training is told with the codes.
- **Seconds**: upper bounds where several trainings shared a GPU, as most did; any-zones had one for itself, while
  others trained on the same host.
- **Seconds of codes by dynamic programming**, of agents with them and of strict agents: of H100s, in part in several
  sessions; twelve processes drew the formulas of these codes.
- **Curves**: of long trainings they are kept at every n-th iteration, and in newer ones at closer iterations of the
  last 5 %.

### What was chosen after results had been seen

The agents have not seen the formulas of the tests; we have. The settings of any-flat (seeds from 40), any-zones and
any-water (from 60), and of the broad family (from 76) were chosen on seeds from 100 on, after results of earlier
settings had been seen on these very formulas. None of these trials is stored.

- **any-zones**: an agent before it had stayed below the aim on j8 and g3. Then came 18 settings of 3 seeds (100 to
  102), 40 million frames (one: 80), judged by success on four formulas that are no tests, but were made like j8 and g3;
  none was tested on the tests. The best at 40 million frames was trained for 100 million, without a trial of that, and
  tested. It was then made again by the same settings and seeds, since its parameters had not been kept, and is shown as
  it was made last.
- **any-water**: eight settings, judged by success and steps on `phi_water`, before an agent that was stored, and others
  after it, on a CPU, which were not counted. Four agents were stored one after another, each after the one before had
  stayed below its aim. The one shown got a farther discount (.995, so that its returns are higher than theirs for the
  same steps) and more frames, without a trial before. Its mean is over the bar; its interval over seeds includes it.
- **any-flat**: two settings. These and WaterWorld's eight were tested on the formulas of the tests themselves. It was
  trained a second time by the same settings and seeds, to have its parameters, and is shown as made last.
- **The broad family**: told with the codes.
- **Codes by dynamic programming, and strict agents** (seeds from 88): both came after all other results on this page
  had been seen, the former because the Transformer and the GRU that had learned by playing stayed behind on g1, g2 and
  long. Step sizes of .001 to .005 (Transformer) and of .001 and .003 (GRU) were tried on seeds 100 to 102; how many
  trials, and what they were judged by, is not recorded. The settings of the strict agents are those of the others, and
  nothing was tried for them. any-letters-strict and any-flat-strict were made twice by the same settings and seeds,
  since a machine was gone with what was to follow, and are shown as made first; the GRU's pre-training likewise, and is
  shown as made last, since its agents began with that.

### What is built and was not trained to a result

Tested on small problems alone: two codes side by side (`joined`), other names of propositions in every episode
(`renaming`), a curriculum of stages with sampling by failure, balls that are asked by attention instead of pooled, and
the network over balls in DQN. In the table of codes no agent is strict: training met rows of most levels, which stand
beside them, and what a code comes to on rows that it never met under any renaming is known of the look-ahead alone.
A certificate, where there is one, is of one seed.

### Whose the other figures are

See `experiments/paper/published_any.py`.

- DeepLTL's, RAD's, GCRL-LTL's and LTL2Action's come from DeepLTL's own result files, deterministic in ZoneEnv.
  LTL2Action is as DeepLTL's authors trained it again, on a family that is not named, but for the walled ZoneEnv.
- GenZ-LTL are its shipped models, played by this project in the closed form of the same physics, five models with 500
  maps each. These figures are not published, and their episodes not stored.
- The script in WaterWorld is `experiments.paper.scripted_player`, played by this project; its steps are of all of its
  episodes.
- Means of others over several formulas are of the figures shown. The return beside them counts 0 for an episode that
  fails.
- letters_reach_12 and letters_avoid_6 are inferred from their names, R-12 and RA-6. Ours have 150 and 75 moves; which
  limits theirs had is not published.

{other_worlds()}"""
