"""The scene that the published environment runs in, for MuJoCo itself: what the cheaper walls are measured against."""

import mujoco

ROBOT = """
<body name="robot" pos="0 0 .1">
  <joint type="slide" axis="1 0 0" damping=".01"/>
  <joint type="slide" axis="0 1 0" damping=".01"/>
  <joint name="hinge" type="hinge" axis="0 0 1" damping=".005"/>
  <geom type="sphere" size=".1" friction="1 .01 .01"/>
  <geom type="box" pos=".1 0 0" size=".05 .05 .05"/>
  <site name="origin"/>
</body>"""

LIMITS = 'ctrllimited="true" ctrlrange="-1 1" forcelimited="true" forcerange="-.05 .05"'

ACTUATORS = f"""
<actuator>
  <motor site="origin" gear=".3 0 0 0 0 0" {LIMITS}/>
  <velocity joint="hinge" gear=".3" kv="1" {LIMITS}/>
</actuator>"""


def original_xml() -> str:
    """The published scene: a floor, 51 cubes along each side of the arena, the robot; MuJoCo's default solver."""
    side = [round(-2.5 + 0.1 * i, 10) for i in range(51)]
    centres = [(x, y) for x in side for y in (-2.5, 2.5)] + [(x, y) for x in (-2.5, 2.5) for y in side]
    walls = "".join(
        f'<geom name="wall{i}" type="box" size=".1 .1 .1" pos="{x} {y} .1"/>' for i, (x, y) in enumerate(centres)
    )
    return (
        '<mujoco><option timestep=".002"/><default><geom condim="6" density="1"/></default>'
        f'<worldbody><geom type="plane" size="3.5 3.5 .1"/>{walls}{ROBOT}</worldbody>{ACTUATORS}</mujoco>'
    )


def original_model() -> mujoco.MjModel:
    """The same as a model. ``qpos`` is the position in metres and the heading in radians, as in ``PointState``."""
    return mujoco.MjModel.from_xml_string(original_xml())
